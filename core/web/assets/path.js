// The programmed path, and what was driven of it. The programmed path is drawn when it or the view changes; what is driven is added
// to a second picture above it, so that a long program costs nothing while it is driven.
import { Camera } from "./camera.js";
import { Lines } from "./lines.js";
import { machine, onFrame } from "./machine.js";
import { fixed, text } from "./words.js";

const COLOURS = ["faint", "line", "grid", "soft"];
const [FEED, RAPID, GRID, BOX] = [0, 1, 2, 3];
const MAX_DRIVEN = 200000;
const STILL_AFTER_MS = 140;
// Of more lines than this each is one pixel wide while the view moves, and of more than that always: without a graphics unit the
// processor draws them.
const MAX_WIDE_MOVING = 20000, MAX_WIDE = 80000;
// While a long path comes in, its picture is made now and then.
const FETCHING_EVERY_MS = 600;

const at = (id) => document.getElementById(id);
const camera = new Camera();
let programmed, drivenCanvas, lines, draw;
let generation = null, pieces = 0, last = null, box = null, fetching = false;
let driven = [], drawnTo = 0, drivenFrom = 0;
let movedAt = 0, wasFitted = false;

export function pathView() {
  programmed = at("path-programmed");
  drivenCanvas = at("path-driven");
  try { lines = new Lines(programmed); } catch (error) { text("path-note", error.message); return; }
  draw = onFrame(drawAll);
  const moved = () => { movedAt = performance.now(); draw(); setTimeout(draw, STILL_AFTER_MS + 20); };
  camera.listen(programmed, moved);
  programmed.addEventListener("dblclick", fit);
  at("fit").addEventListener("click", fit);
  for (const button of at("views").children) {
    button.addEventListener("click", () => { camera.show(button.dataset.view); press(); fit(); });
  }
  press();
  machine.on("described", () => { begin(null); fit(); });
  machine.on("status", onFrame(follow));
  machine.link.on("away", () => { generation = null; });
  new ResizeObserver(() => { if (!wasFitted) fit(); draw(); }).observe(programmed);
}

function press() {
  for (const button of at("views").children) button.setAttribute("aria-pressed", String(button.dataset.view === camera.name));
}

// The axes that span space: X, Y and Z where the machine has them, else its first linear ones.
function spaceAxes() {
  const { axes } = machine.described;
  const named = ["x", "y", "z"].map((letter) => axes.find((axis) => axis.axis === letter));
  if (named.some(Boolean)) return named;
  const linear = axes.filter((axis) => axis.unit === "mm");
  return [0, 1, 2].map((place) => linear[place]);
}

function pointOf(position) {
  return spaceAxes().map((axis) => (axis ? position[machine.key(axis)] : 0));
}

// An empty picture: the travel of the machine.
function begin(next) {
  [generation, pieces, last, box] = [next, 0, null, null];
  [driven, drawnTo, drivenFrom] = [[], 0, 0];
  if (!lines || !machine.described) return;
  lines.clear();
  const [low, high] = travel();
  const step = gridStep(Math.max(high[0] - low[0], high[1] - low[1]));
  for (let x = Math.ceil(low[0] / step) * step; x <= high[0]; x += step) lines.add(x, low[1], low[2], x, high[1], low[2], GRID);
  for (let y = Math.ceil(low[1] / step) * step; y <= high[1]; y += step) lines.add(low[0], y, low[2], high[0], y, low[2], GRID);
  const corner = (bits) => [0, 1, 2].map((axis) => (bits >> axis & 1 ? high : low)[axis]);
  for (let bits = 0; bits < 8; bits++) {
    for (const axis of [1, 2, 4]) if (!(bits & axis)) lines.add(...corner(bits), ...corner(bits | axis), bits & 4 || axis === 4 ? RAPID : BOX);
  }
  draw();
}

function travel() {
  const axes = spaceAxes();
  const ends = (name, other) => axes.map((axis) => (axis && Number.isFinite(axis[name]) ? axis[name] : other));
  return [ends("min", 0), ends("max", 0)];
}

function gridStep(size) {
  const power = 10 ** Math.floor(Math.log10(Math.max(size, 1) / 8));
  return power * [1, 2, 5, 10].find((m) => size / (power * m) <= 14);
}

function fit() {
  if (!machine.described || !lines) return;
  camera.fit(box || travel(), programmed.clientWidth, programmed.clientHeight);
  wasFitted = programmed.clientWidth > 0;
  drawnTo = 0;
  draw();
}

function include(point) {
  box ||= [[...point], [...point]];
  for (const axis of [0, 1, 2]) {
    box[0][axis] = Math.min(box[0][axis], point[axis]);
    box[1][axis] = Math.max(box[1][axis], point[axis]);
  }
}

// A status has come: where the machine is, and whether there is more of the path.
function follow() {
  const { status, described } = machine;
  if (!status || !described || !lines) return;
  if (status.path) fetchPath(status.path);
  else drive(pointOf(status.position), status.job);
  draw();
}

let lastJob = null;
function drive(point, job) {
  if (job !== lastJob && job === "program") { driven = []; drawnTo = 0; }
  lastJob = job;
  if (job) addDriven(point);
}

function addDriven(point) {
  const end = driven[driven.length - 1];
  if (end && end.every((value, axis) => value === point[axis])) return;
  driven.push(point);
  if (driven.length > MAX_DRIVEN) { driven = driven.slice(MAX_DRIVEN / 2); drawnTo = 0; }
}

// Fetches what is not here yet, answer by answer; each is small, so that no task holds up the page.
async function fetchPath({ generation: now, count, driven_count: drivenCount }) {
  if (fetching) return;
  if (now !== generation) begin(now);
  if (pieces >= count && drivenFrom >= drivenCount) return;
  fetching = true;
  try {
    let told;
    do {
      told = await machine.link.ask("path", { from: pieces, driven_from: drivenFrom });
      if (told.generation !== generation) begin(told.generation);
      take(told);
    } while (pieces < told.count || drivenFrom < told.driven_count);
    if (told.count === pieces && count > 0 && fittedOf !== generation) { fittedOf = generation; fit(); }
    text("path-note", told.beyond ? `${told.beyond} blocks more are not drawn` : "");
  } catch { /* asked again with the next status */ } finally { fetching = false; draw(); }
}
let fittedOf = null;

function take({ axes, from, pieces: all, driven_from: first, driven: places }) {
  const order = spaceAxes().map((axis) => (axis ? axes.indexOf(machine.key(axis)) : -1));
  const space = (values) => order.map((place) => (place < 0 ? 0 : values[place]));
  for (const piece of all) {
    let here = piece.from ? space(piece.from) : last;
    for (const values of piece.points) {
      const next = space(values);
      if (here) {
        lines.add(...here, ...next, piece.rapid ? RAPID : FEED);
        if (!piece.rapid) { include(here); include(next); }
      }
      here = next;
    }
    last = here;
  }
  pieces = from + all.length;
  for (const values of places) addDriven(space(values));
  drivenFrom = first + places.length;
  draw();
}

let viewKey = "", madeAt = 0;
function drawAll() {
  if (!lines) return;
  const style = getComputedStyle(document.documentElement);
  const css = (name) => style.getPropertyValue("--" + name).trim();
  const isMoving = performance.now() - movedAt < STILL_AFTER_MS;
  const key = [camera.right, camera.up, camera.centre, camera.scale, programmed.clientWidth, programmed.clientHeight, lines.count, isMoving, document.documentElement.dataset.theme].join();
  const now = performance.now();
  const isDue = !fetching || isMoving || lines.count < MAX_WIDE_MOVING || now - madeAt > FETCHING_EVERY_MS;
  if (key !== viewKey && isDue) {
    lines.draw(camera, COLOURS.map((name) => rgba(css(name))), 1.6, lines.count > (isMoving ? MAX_WIDE_MOVING : MAX_WIDE));
    madeAt = now;
    viewKey = key;
    machine.drawnLines = lines.count;
    drawnTo = 0;
  }
  drawDriven(css);
}

function drawDriven(css) {
  const canvas = drivenCanvas, ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== wide || canvas.height !== high) { Object.assign(canvas, { width: wide, height: high }); drawnTo = 0; }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  if (!layer || layer.width !== wide || layer.height !== high) { layer = new OffscreenCanvas(Math.max(wide, 1), Math.max(high, 1)); drawnTo = 0; }
  const kept = layer.getContext("2d");
  kept.setTransform(ratio, 0, 0, ratio, 0, 0);
  if (drawnTo === 0) kept.clearRect(0, 0, width, height);
  if (driven.length > drawnTo) {
    kept.strokeStyle = css("good");
    kept.lineWidth = 2.4;
    kept.lineJoin = kept.lineCap = "round";
    kept.beginPath();
    const first = Math.max(drawnTo - 1, 0);
    kept.moveTo(...camera.screen(driven[first], width, height));
    for (let i = first + 1; i < driven.length; i++) kept.lineTo(...camera.screen(driven[i], width, height));
    kept.stroke();
    drawnTo = driven.length;
  }
  context.clearRect(0, 0, width, height);
  context.save();
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.drawImage(layer, 0, 0);
  context.restore();
  if (machine.status && machine.described) drawTool(context, width, height, css);
  drawTriad(context, height, css);
}
let layer = null;

function drawTool(context, width, height, css) {
  const [x, y] = camera.screen(pointOf(machine.status.position), width, height);
  context.fillStyle = css("ink");
  context.strokeStyle = css("card");
  context.lineWidth = 2;
  context.beginPath();
  if (camera.name === "XY") context.arc(x, y, 6, 0, 2 * Math.PI);
  else { context.moveTo(x, y); context.lineTo(x - 7, y - 20); context.lineTo(x + 7, y - 20); context.closePath(); }
  context.fill();
  context.stroke();
}

function drawTriad(context, height, css) {
  const origin = [44, height - 40], arm = 28;
  context.lineWidth = 2;
  context.font = "600 13px system-ui, 'Liberation Sans', sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  ["x", "y", "z"].forEach((name, axis) => {
    const [x, y] = [camera.right[axis] * arm, -camera.up[axis] * arm];
    if (Math.hypot(x, y) < 3) return;
    context.strokeStyle = context.fillStyle = css(name);
    context.beginPath();
    context.moveTo(...origin);
    context.lineTo(origin[0] + x, origin[1] + y);
    context.stroke();
    context.fillText(name.toUpperCase(), origin[0] + x * 1.34, origin[1] + y * 1.34);
  });
  const length = barLength(camera.scale);
  const label = length >= 1 ? `${length} mm` : `${fixed(length * 1000, 0)} µm`;
  const right = drivenCanvas.clientWidth - 16, y = height - 14;
  context.strokeStyle = context.fillStyle = css("soft");
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(right - length * camera.scale, y);
  context.lineTo(right, y);
  context.stroke();
  context.textAlign = "right";
  context.font = "13px system-ui, 'Liberation Sans', sans-serif";
  context.fillText(label, right, y - 12);
}

// The largest of 1, 2, 5, 10, 20, … mm that is not longer than 110 pixels.
function barLength(scale) {
  const most = 110 / scale, power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].find((m) => m * power <= most) * power;
}

function rgba(hex) {
  const number = parseInt(hex.slice(1, 7), 16);
  return [(number >> 16 & 255) / 255, (number >> 8 & 255) / 255, (number & 255) / 255, 1];
}
