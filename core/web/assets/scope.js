// Signals of every fine period, with the limits of the machine as lines: as they come, or around the instant of a trigger. Where the
// machine stops by a fault the picture stays.
import { machine, onFrame } from "./machine.js";
import { showGauge } from "./readouts.js";
import { element, say, text } from "./words.js";

export const MAX_SIGNALS = 8;
const SPAN_S = 5;
const EVERY_MS = 100;
const KEPT_ROWS = 20000;
const COLOURS = ["x", "y", "z", "a", "b", "c", "main", "u"];
const SIGNALS = "signals";

// What is plotted: its name, the order of the derivative of the command, and the unit behind that of the axis.
const WHAT = [
  ["velocity", "Velocity", 1, "/s"], ["acceleration", "Acceleration", 2, "/s²"], ["jerk", "Jerk", 3, "/s³"],
  ["following", "Following error", 0, ""], ["feed", "Feed", 0, "/s"], [SIGNALS, "Chosen signals", 0, null],
];

const at = (id) => document.getElementById(id);
let what = WHAT[0];
let chosen = remembered();
let columns = [];
let asked = [];
let plot = null;
let isFrozen = false, isHeldAtFault = false, captured = null;
let lost = 0, nextTick = null, drawnAt = 0;

export function scopeView() {
  const select = at("scope-what");
  select.replaceChildren(...WHAT.map(([value, label]) => element("option", { value }, label)));
  select.addEventListener("change", () => { what = WHAT.find(([name]) => name === select.value); begin(); });
  at("scope-hold").addEventListener("click", () => {
    if (captured) { captured = null; begin(); } else { isFrozen = !isFrozen; isHeldAtFault = false; }
    show();
  });
  machine.on("described", begin);
  machine.on("theme", () => { if (plot) plot.redraw(); });
  machine.link.on("scope", take);
  machine.link.on("state", ({ state }) => {
    if (state === "fault" || state === "emergency-stop") isHeldAtFault = true;
    else if (state !== "stopping") isHeldAtFault = false;
    show();
  });
  new ResizeObserver(onFrame(() => {
    const place = at("scope");
    if (plot && place.clientWidth) plot.setSize({ width: place.clientWidth, height: place.clientHeight });
  })).observe(at("scope"));
}

function remembered() {
  try { const kept = JSON.parse(localStorage.getItem("signals")); return Array.isArray(kept) ? kept : []; } catch { return []; }
}

// Every signal that the machine has.
export function signalsOf({ axes, inputs, outputs }) {
  const each = axes.flatMap(({ axis, unit }) => [`${axis}_cmd_${unit}`, `${axis}_fb_${unit}`, `${axis}_following_${unit}`, `${axis}_fb_${unit}_s`, `${axis}_current_a`]);
  return [...each, "feed_mm_s", "sigma", "ratio", "line", "block", "spindle_set_rpm", "spindle_rpm",
    ...inputs.map((name) => `input_${name}`), ...outputs.map((name) => `output_${name}`)];
}

export function chosenSignals() { return chosen; }

// Plots these signals, at most MAX_SIGNALS.
export function chooseSignals(names) {
  chosen = names.slice(0, MAX_SIGNALS);
  localStorage.setItem("signals", JSON.stringify(chosen));
  what = WHAT.find(([name]) => name === SIGNALS);
  at("scope-what").value = SIGNALS;
  begin();
}

// The signals that the curves in force are made of.
export function signalsInForce() { return asked; }

// Shows the rows of a capture, time from its trigger on, until somebody wants to look at what comes.
export function showCapture({ rows, trigger_row: trigger, period_s }) {
  captured = { trigger };
  columns = emptyColumns();
  let states = new Map();
  rows.forEach((row, index) => { states = push((index - trigger) * period_s, row, states, period_s, null); });
  show();
  drawNow([columns[0][0] ?? 0, columns[0][columns[0].length - 1] ?? 1]);
}

function show() {
  const stays = isFrozen || isHeldAtFault;
  at("scope-hold").setAttribute("aria-pressed", String(Boolean(stays || captured)));
  at("scope-hold").title = captured ? "Show what comes" : isHeldAtFault ? "The picture stands at the fault" : "";
  text("scope-hold", captured ? "Captured" : isHeldAtFault ? "Held" : isFrozen ? "Frozen" : "Freeze");
}

// The curves that are shown, with the axis or the signal behind each.
function curves() {
  const { axes } = machine.described;
  const plain = (signal, index) => ({ label: signal, signal, ...painted(COLOURS[index % COLOURS.length]) });
  if (what[0] === SIGNALS) return known(chosen).map(plain);
  if (what[0] === "feed") return [{ label: "feed", signal: "feed_mm_s", ...painted("main") }];
  return axes.slice(0, MAX_SIGNALS / 2).map((axis) => ({
    label: axis.axis.toUpperCase(), axis, ...painted(axis.axis), limit: limitOf(axis),
    signal: what[0] === "following" ? `${axis.axis}_following_${axis.unit}` : null,
  }));
}

const painted = (key) => ({ key, colour: () => colour(key) });

function known(names) {
  const all = signalsOf(machine.described);
  return names.filter((name) => all.includes(name));
}

function limitOf(axis) {
  return { velocity: axis.max_rapid_per_min / 60, acceleration: axis.max_acceleration_per_s2, jerk: axis.max_jerk_per_s3 }[what[0]];
}

const emptyColumns = () => [[], ...curves().map(() => [])];

async function begin() {
  const { axes } = machine.described;
  captured = null;
  nextTick = null;
  columns = emptyColumns();
  build();
  show();
  machine.scoped = false;
  // Until the answer is here what comes is of the signals before.
  asked = [];
  // Commands first: velocity, acceleration and jerk of the gauges are made of them.
  const own = curves().map(({ signal }) => signal).filter(Boolean);
  const commands = axes.map(({ axis, unit }) => `${axis}_cmd_${unit}`).filter((name) => !own.includes(name));
  const all = [...own, ...commands.slice(0, Math.max(MAX_SIGNALS - own.length, 0))];
  try {
    await machine.link.ask("scope", { signals: all });
    asked = all;
    machine.scoped = true;
  } catch (error) { say(error.message); }
}

function build() {
  if (plot) plot.destroy();
  const place = at("scope"), all = curves();
  const units = [...new Set(all.map(({ axis }) => (axis ? axis.unit : "mm")))].join(" · ");
  const keys = all.map((curve) => element("span", { style: `--key: var(--${curve.key}, var(--ink))` }, curve.label));
  at("scope-keys").replaceChildren(...keys, element("i", {}, what[3] === null ? "" : units + what[3]));
  const values = all.map(() => [null, null]);
  plot = timePlot(place, {
    label: `Scope: ${what[1]}`, times: [0, SPAN_S], curves: all.map((curve, index) => ({ ...curve, values: values[index] })),
    hasTime: true, fromZero: what[0] === "feed", least: what[0] === "following" ? 1e-3 : what[0] === SIGNALS ? 1e-6 : 1,
    valueAxis: { size: 52 }, hooks: { draw: [drawTrigger] },
  });
}

function drawTrigger(u) {
  if (!captured) return;
  const x = Math.round(u.valToPos(0, "x", true)) + 0.5;
  u.ctx.strokeStyle = colour("warn");
  u.ctx.lineWidth = 1.5 * uPlot.pxRatio;
  line(u.ctx, x, u.bbox.top, x, u.bbox.top + u.bbox.height);
}

// Rows of every fine period.
let states = new Map();
function take({ tick, every, rows, lost: before }) {
  if (before) {
    lost += before;
    text("scope-lost", `${lost} frames lost`);
    at("scope-lost").title = "This page reads too slowly for all that is told; the machine does not wait for it";
  }
  const { axes, fine_period_s } = machine.described;
  const periods = every || 1, seconds = fine_period_s * periods;
  if (rows.length && rows[0].length !== asked.length) return;
  if (tick !== nextTick) states = new Map();
  nextTick = tick + rows.length * periods;
  machine.scopedRows = (machine.scopedRows || 0) + rows.length;
  const stays = isFrozen || isHeldAtFault || captured;
  const peaks = new Map(axes.map(({ axis }) => [axis, [0, 0, 0]]));
  rows.forEach((row, index) => { states = push((tick + index * periods) * fine_period_s, row, states, seconds, peaks, stays); });
  for (const axis of axes) peaks.get(axis.axis).forEach((peak, order) => showGauge(axis, order, peak));
  if (!stays) draw();
}

// A row: differences of the commanded positions are velocity, acceleration and jerk as the drives see them.
function push(t, row, before, seconds, peaks, stays) {
  const after = new Map();
  for (const { axis, unit } of machine.described.axes) {
    const place = asked.indexOf(`${axis}_cmd_${unit}`);
    if (place < 0) continue;
    const last = before.get(axis) || [], next = [row[place]];
    for (let order = 1; order <= 3; order++) {
      next[order] = Number.isFinite(last[order - 1]) ? (next[order - 1] - last[order - 1]) / seconds : NaN;
      if (peaks && Math.abs(next[order]) > peaks.get(axis)[order - 1]) peaks.get(axis)[order - 1] = Math.abs(next[order]);
    }
    after.set(axis, next);
  }
  if (!stays) {
    const times = columns[0];
    // A job counts its periods from 0 on.
    if (times.length && t < times[times.length - 1]) columns = emptyColumns();
    columns[0].push(t);
    curves().forEach(({ axis, signal }, index) => {
      const value = signal ? row[asked.indexOf(signal)] : (after.get(axis.axis) || [])[what[2]];
      columns[index + 1].push(Number.isFinite(value) ? value : null);
    });
    if (columns[0].length > KEPT_ROWS) columns = columns.map((column) => column.slice(-KEPT_ROWS / 2));
  }
  return after;
}

function drawNow([from, to]) {
  plot.batch(() => {
    plot.setData(columns, false);
    plot.setScale("x", { min: from, max: to });
  });
}

const draw = onFrame(() => {
  const now = performance.now(), times = columns[0];
  if (now - drawnAt < EVERY_MS || times.length < 2 || captured) return;
  drawnAt = now;
  const end = Math.max(times[times.length - 1], SPAN_S);
  drawNow([end - SPAN_S, end]);
});
