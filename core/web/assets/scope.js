// Signals of every fine period, with the limits of the machine as lines. Where the machine stops by a fault the picture stays.
import { machine, onFrame } from "./machine.js";
import { showGauge } from "./readouts.js";
import { element, say, text } from "./words.js";

const MAX_SIGNALS = 8;
const SPAN_S = 5;
const EVERY_MS = 100;
// Points across the picture: more than there are pixels show nothing more.
const MAX_POINTS = 1500;

const WHAT = [
  ["velocity", "Velocity", 1], ["acceleration", "Acceleration", 2], ["jerk", "Jerk", 3], ["following", "Following error", 0], ["feed", "Feed", 0],
];

const at = (id) => document.getElementById(id);
let what = "velocity";
let columns = [];
let signals = [];
let plot = null;
let frozen = false;
let heldAtFault = false;
let lost = 0;
let previous = null;
let drawnAt = 0;

export function scopeView() {
  const select = at("scope-what");
  select.replaceChildren(...WHAT.map(([value, label]) => element("option", { value }, label)));
  select.addEventListener("change", () => { what = select.value; begin(); });
  at("scope-hold").addEventListener("click", () => { frozen = !frozen; heldAtFault = false; show(); });
  machine.on("described", begin);
  machine.link.on("scope", take);
  machine.link.on("state", ({ state }) => {
    if (state === "fault" || state === "emergency-stop") { heldAtFault = true; show(); }
    else if (heldAtFault && state !== "stopping") { heldAtFault = false; show(); }
  });
  machine.on("status", (status) => { if (status && !machine.scoped) takeStatus(status); });
  new ResizeObserver(onFrame(() => {
    const place = at("scope");
    if (plot && place.clientWidth) plot.setSize({ width: place.clientWidth, height: place.clientHeight });
  })).observe(at("scope"));
}

function show() {
  at("scope-hold").setAttribute("aria-pressed", String(frozen || heldAtFault));
  at("scope-hold").title = heldAtFault ? "The picture stands at the fault" : "";
  at("scope-hold").textContent = heldAtFault ? "Held" : frozen ? "Frozen" : "Freeze";
}

// The curves that are shown, with the axis or the signal behind each.
function curves() {
  const { axes } = machine.described;
  if (what === "feed") return [{ label: "feed mm/s", signal: "feed_mm_s", key: "accent" }];
  return axes.slice(0, MAX_SIGNALS / 2).map((axis) => ({ label: axis.axis.toUpperCase(), axis, key: axis.axis }));
}

async function begin() {
  const { axes } = machine.described;
  columns = [[], ...curves().map(() => [])];
  previous = null;
  build();
  machine.scoped = false;
  if (!machine.knows("scope")) return;
  const commands = axes.map((axis) => `${axis.axis}_cmd_${axis.unit}`);
  const more = what === "following" ? axes.map((axis) => `${axis.axis}_following_${axis.unit}`) : ["feed_mm_s"];
  const asked = [...commands, ...more].slice(0, MAX_SIGNALS);
  try {
    await machine.link.ask("scope", { signals: asked });
    signals = asked;
    machine.scoped = true;
  } catch (error) { say(error.message); }
}

function unit() {
  const per = { velocity: "mm/s", acceleration: "mm/s²", jerk: "mm/s³", following: "mm", feed: "mm/s" };
  return per[what];
}

function limitOf(axis) {
  return { velocity: axis.max_rapid_per_min / 60, acceleration: axis.max_acceleration_per_s2, jerk: axis.max_jerk_per_s3 }[what];
}

function build() {
  if (plot) plot.destroy();
  const place = at("scope");
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const axisStyle = { stroke: css("soft"), grid: { stroke: css("grid"), width: 1 }, ticks: { show: false }, font: "12px system-ui, sans-serif" };
  const all = curves();
  at("scope-keys").replaceChildren(...all.map(({ label, key }) => element("span", { style: `--key: var(--${key}, var(--accent))` }, label)), element("i", {}, unit()));
  const options = {
    width: Math.max(place.clientWidth, 200), height: Math.max(place.clientHeight, 100),
    padding: [6, 16, 0, 0], legend: { show: false }, cursor: { show: false }, pxAlign: 0,
    scales: { x: { time: false }, y: { range } },
    axes: [{ ...axisStyle, size: 24, values: (_, places) => places.map((place) => `${place} s`) }, { ...axisStyle, size: 58 }],
    series: [{}, ...all.map(({ key }) => ({ stroke: css(key) || css("accent"), width: 1.6, points: { show: false } }))],
    hooks: { draw: [(u) => limits(u, css("bad"))] },
  };
  plot = new uPlot(options, [[0, SPAN_S], ...all.map(() => [0, 0])], place);
}

// What is drawn, with a limit wherever a curve comes near it: then the distance to it is what matters.
function range(_, low, high) {
  const most = Math.max(Math.abs(low || 0), Math.abs(high || 0));
  const near = curves().map(({ axis }) => axis && limitOf(axis)).filter((limit) => Number.isFinite(limit) && most > limit * 0.4);
  const top = Math.max(most * 1.12, ...near.map((limit) => limit * 1.08), what === "following" ? 1e-3 : 1);
  return low < 0 ? [-top, top] : [0, top];
}

function limits(u, colour) {
  const { ctx, bbox } = u;
  const all = new Set(curves().map(({ axis }) => axis && limitOf(axis)).filter(Number.isFinite));
  ctx.save();
  ctx.strokeStyle = colour;
  ctx.setLineDash([8, 5]);
  ctx.lineWidth = 1.2 * devicePixelRatio;
  for (const limit of all) {
    for (const value of [limit, -limit]) {
      if (value > u.scales.y.max || value < u.scales.y.min) continue;
      const y = u.valToPos(value, "y", true);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
  }
  ctx.restore();
}

// Rows of every fine period: differences of the commanded positions are velocity, acceleration and jerk as the drives see them.
const history = new Map();
function take({ tick, every, rows, lost: before }) {
  if (before) {
    lost += before;
    text("scope-lost", `${lost} frames lost`);
    at("scope-lost").title = "This page reads too slowly for all that is told; the machine does not wait for it";
  }
  const { axes, fine_period_s } = machine.described;
  const seconds = fine_period_s * (every || 1);
  const peaks = axes.map(() => [0, 0, 0]);
  if (previous !== null && tick !== previous) history.clear();
  previous = tick + rows.length * (every || 1);
  const stays = frozen || heldAtFault;
  rows.forEach((row, index) => {
    const values = axes.map((axis, place) => {
      const place0 = signals.indexOf(`${axis.axis}_cmd_${axis.unit}`);
      const states = history.get(axis.axis) || [];
      const next = [row[place0]];
      for (let order = 1; order <= 3; order++) {
        const last = states[order - 1];
        next[order] = Number.isFinite(last) && Number.isFinite(next[order - 1]) ? (next[order - 1] - last) / seconds : NaN;
        if (Math.abs(next[order]) > peaks[place][order - 1]) peaks[place][order - 1] = Math.abs(next[order]);
      }
      history.set(axis.axis, next);
      return next;
    });
    if (!stays) keep((tick + index * (every || 1)) * fine_period_s, values, row);
  });
  axes.forEach((axis, place) => peaks[place].forEach((peak, order) => showGauge(axis, order, peak)));
  if (!stays) draw();
}

function keep(t, values, row) {
  const order = { velocity: 1, acceleration: 2, jerk: 3 }[what];
  const shown = curves().map(({ axis, signal }, place) => {
    if (signal) return row[signals.indexOf(signal)];
    if (what === "following") return row[signals.indexOf(`${axis.axis}_following_${axis.unit}`)];
    return values[place][order];
  });
  push(t, shown.map((value) => (Number.isFinite(value) ? value : null)));
}

function push(t, shown) {
  const times = columns[0];
  // A job counts its periods from 0 on.
  if (times.length && t < times[times.length - 1]) columns = columns.map(() => []);
  columns[0].push(t);
  shown.forEach((value, place) => columns[place + 1].push(value));
  if (columns[0].length > 20000) columns = columns.map((column) => column.slice(-12000));
}

// Without the scope: means between two looks at the machine.
let before = null;
function takeStatus(status) {
  if (frozen || heldAtFault || !plot) return;
  const last = before;
  before = status;
  if (!last || status.tick <= last.tick) return;
  const { axes, fine_period_s } = machine.described;
  const seconds = (status.tick - last.tick) * fine_period_s;
  if (what === "feed") push(status.tick * fine_period_s, [status.feed_mm_per_min / 60]);
  else if (what === "velocity") push(status.tick * fine_period_s, axes.slice(0, MAX_SIGNALS / 2).map((axis) => (status.position[machine.key(axis)] - last.position[machine.key(axis)]) / seconds));
  draw();
}

const draw = onFrame(() => {
  const now = performance.now();
  if (now - drawnAt < EVERY_MS || columns[0].length < 2) return;
  drawnAt = now;
  const end = columns[0][columns[0].length - 1];
  let first = columns[0].length - 1;
  while (first > 0 && columns[0][first] > end - SPAN_S) first--;
  plot.batch(() => {
    plot.setData(thin(columns.map((column) => column.slice(first))), true);
    plot.setScale("x", { min: Math.max(end - SPAN_S, 0), max: Math.max(end, SPAN_S) });
  });
});

// Of each stretch its lowest and its highest value, so that no peak is lost.
function thin(all) {
  const count = all[0].length, per = Math.ceil(count / MAX_POINTS) * 2;
  if (per <= 2) return all;
  const kept = all.map(() => []);
  for (let start = 0; start < count; start += per) {
    const end = Math.min(start + per, count);
    kept[0].push(all[0][start], all[0][end - 1]);
    for (let k = 1; k < all.length; k++) {
      let low = Infinity, high = -Infinity;
      for (let i = start; i < end; i++) { const value = all[k][i]; if (value === null) continue; if (value < low) low = value; if (value > high) high = value; }
      kept[k].push(low === Infinity ? null : low, high === -Infinity ? null : high);
    }
  }
  return kept;
}
