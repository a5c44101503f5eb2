"use strict";

// What goes wrong is kept on the page, so that a test (and a person) can see it.
function reportError(error) {
  const root = document.documentElement;
  root.dataset.errors = (root.dataset.errors ? root.dataset.errors + "\n" : "") + error;
}
window.addEventListener("error", (event) => reportError(event.message));
window.addEventListener("unhandledrejection", (event) => reportError(event.reason));

const about = JSON.parse(document.getElementById("about").textContent);

// Columns by name: typed arrays of equal length; a column that the run does not have is undefined.
const columns = {};

const COLUMN_TYPES = { f32: Float32Array, f64: Float64Array, u32: Uint32Array, u8: Uint8Array };

function bytesOfBase64(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

async function inflate(bytes) {
  const { writable, readable } = new DecompressionStream("deflate");
  const writer = writable.getWriter();
  const written = writer.write(bytes).then(() => writer.close());
  const chunks = [];
  for (const reader = readable.getReader(); ;) {
    const { value, done } = await reader.read();
    if (done) break;
    chunks.push(value);
  }
  await written;
  return joinChunks(chunks);
}

function joinChunks(chunks) {
  const whole = new Uint8Array(chunks.reduce((sum, chunk) => sum + chunk.length, 0));
  let at = 0;
  for (const chunk of chunks) {
    whole.set(chunk, at);
    at += chunk.length;
  }
  return whole;
}

// The bytes of equal weight stand side by side; this puts each number together again.
function joinPlanes(planes, type) {
  const width = type.BYTES_PER_ELEMENT;
  const n = planes.length / width;
  const bytes = new Uint8Array(planes.length);
  for (let place = 0; place < width; place++) {
    for (let i = 0; i < n; i++) bytes[i * width + place] = planes[place * n + i];
  }
  return new type(bytes.buffer);
}

async function readColumn(element) {
  const planes = await inflate(bytesOfBase64(element.textContent));
  columns[element.id.slice("column-".length)] = joinPlanes(planes, COLUMN_TYPES[element.dataset.kind]);
  element.remove();
}

async function readColumns() {
  await Promise.all([...document.querySelectorAll("script[data-kind]")].map(readColumn));
}

function positionOf(axis, i) {
  return about.axes[axis].centre + columns["position" + axis][i];
}

// Index of the first sample that is not before `t`.
function indexAt(t) {
  const times = columns.t;
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < t) low = middle + 1; else high = middle;
  }
  return low;
}

function nearestIndex(t) {
  const i = Math.min(indexAt(t), columns.t.length - 1);
  return i > 0 && t - columns.t[i - 1] < columns.t[i] - t ? i - 1 : i;
}

// Extremes of any range of a curve without reading all of it: blocks are summed up once.
const BLOCK = 64;

class Extremes {
  constructor(values) {
    this.values = values;
    const blocks = Math.ceil(values.length / BLOCK);
    this.low = new Float32Array(blocks).fill(Infinity);
    this.high = new Float32Array(blocks).fill(-Infinity);
    for (let i = 0; i < values.length; i++) {
      const block = Math.floor(i / BLOCK);
      if (values[i] < this.low[block]) this.low[block] = values[i];
      if (values[i] > this.high[block]) this.high[block] = values[i];
    }
  }

  // [smallest, largest] of the samples from..to (without `to`); [Infinity, -Infinity] where there is none.
  of(from, to) {
    let low = Infinity, high = -Infinity, i = from;
    while (i < to) {
      const block = i / BLOCK;
      const whole = i % BLOCK === 0 && i + BLOCK <= to;
      const least = whole ? this.low[block] : this.values[i];
      const most = whole ? this.high[block] : this.values[i];
      if (least < low) low = least;
      if (most > high) high = most;
      i += whole ? BLOCK : 1;
    }
    return [low, high];
  }
}
