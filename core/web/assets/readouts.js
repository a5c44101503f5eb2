// Where the machine is, in large digits, and its axes against their limits.
import { machine, onFrame } from "./machine.js";
import { element, fixed, text } from "./words.js";

const rows = new Map();
const gauges = new Map();
let before = null;

export function readouts() {
  machine.on("described", build);
  machine.on("status", onFrame(draw));
}

function build({ axes }) {
  rows.clear();
  gauges.clear();
  before = null;
  const place = document.getElementById("axes");
  place.classList.toggle("many", axes.length > 3);
  const units = new Set(axes.map((axis) => axis.unit));
  text("units", [...units].join(" · "));
  place.replaceChildren(...axes.map((axis) => {
    const row = {
      place: element("span", { class: "place" }, "–"), machine: element("span"), toGo: element("span"), mark: element("u"),
    };
    row.root = element("div", { class: "axis", style: `--key: var(--${axis.axis}, var(--accent))` },
      element("span", { class: "letter" }, axis.axis.toUpperCase()), row.place,
      element("div", { class: "small" }, row.machine, row.toGo),
      element("div", { class: "travel", title: `travel ${axis.min} to ${axis.max} ${axis.unit}` }, row.mark));
    rows.set(axis.axis, row);
    return row.root;
  }));
  const limits = document.getElementById("limits");
  const heads = ["", "velocity", "acceleration", "jerk"].map((name) => element("i", {}, name));
  limits.replaceChildren(...heads, ...axes.flatMap((axis) => {
    const all = ["velocity", "acceleration", "jerk"].map(() => {
      const gauge = { bar: element("u"), peak: element("em", { hidden: "" }), label: element("span", {}, "–"), most: 0 };
      gauge.root = element("div", { class: "gauge", style: `--key: var(--${axis.axis}, var(--accent))` }, element("div", {}, gauge.bar, gauge.peak), gauge.label);
      return gauge;
    });
    gauges.set(axis.axis, all);
    return [element("span", { class: "letter", style: `--key: var(--${axis.axis}, var(--accent))` }, axis.axis.toUpperCase()), ...all.map((g) => g.root)];
  }));
}

function draw() {
  const { status, described } = machine;
  if (!status || !described) return;
  text("system", `Work position · ${status.system}`);
  for (const axis of described.axes) {
    const row = rows.get(axis.axis), key = machine.key(axis);
    const place = status.position[key];
    text(row.place, fixed(status.work_position[key]));
    text(row.machine, `machine ${fixed(place).padStart(9, "\u2007")}`);
    const left = status.distance_to_go && status.distance_to_go[key];
    text(row.toGo, Number.isFinite(left) ? `to go ${fixed(left).padStart(9, "\u2007")}` : "");
    const share = (place - axis.min) / (axis.max - axis.min);
    row.mark.style.left = `${Math.min(Math.max(share, 0), 1) * 100}%`;
    row.root.classList.toggle("unknown", status.not_homed.includes(axis.axis));
  }
  // Where nothing is driven, what is told is the feed of the last period that was.
  text("feed", fixed(status.job ? status.feed_mm_per_min : 0, 0));
  text("spindle", fixed(status.spindle_turns_rpm || status.spindle_rpm, 0));
  text("tool", status.tool ? `T${status.tool}` : "–");
  const length = status.tool_offset.z_mm;
  text("tool-length", length ? `${fixed(length)} mm` : "");
  text("modal", modal(status.modal));
  text("io", words(status));
  if (!machine.scoped) speeds(status, described);
  // The scope tells nothing of a machine at rest.
  if (!status.job) for (const axis of described.axes) for (const order of [0, 1, 2]) showGauge(axis, order, 0);
}

function modal(codes) {
  if (!codes) return "";
  return Array.isArray(codes) ? codes.join(" ") : typeof codes === "object" ? Object.values(codes).flat().join(" ") : String(codes);
}

function words({ inputs, outputs }) {
  const on = (names) => Object.entries(names || {}).map(([name, is]) => `${name} ${is === true ? "on" : is === false ? "off" : is}`);
  return [...on(inputs), ...on(outputs)].join(" · ");
}

// Without the scope: velocity from two looks at the machine, which is a mean of some periods.
function speeds(status, described) {
  const last = before;
  if (last && last.tick === status.tick) return;
  before = status;
  if (!last || status.tick <= last.tick) return;
  const seconds = (status.tick - last.tick) * described.fine_period_s;
  for (const axis of described.axes) {
    const key = machine.key(axis);
    showGauge(axis, 0, Math.abs(status.position[key] - last.position[key]) / seconds);
  }
}

// One of velocity, acceleration, jerk of an axis, per second; the mark stands at the highest of the last seconds.
export function showGauge(axis, order, value) {
  const all = gauges.get(axis.axis);
  if (!all) return;
  const gauge = all[order];
  const limit = [axis.max_rapid_per_min / 60, axis.max_acceleration_per_s2, axis.max_jerk_per_s3][order];
  if (!Number.isFinite(limit) || !limit) { text(gauge.label, Number.isFinite(value) ? short(value) : "–"); return; }
  const share = value / limit;
  gauge.most = Math.max(share, gauge.most * 0.985);
  gauge.bar.style.transform = `scaleX(${Math.min(share, 1)})`;
  gauge.peak.style.left = `${Math.min(gauge.most, 1) * 99}%`;
  gauge.peak.hidden = gauge.most < 0.005;
  gauge.root.classList.toggle("over", gauge.most > 1.001);
  text(gauge.label, `${Math.round(gauge.most * 100)} %`);
}

function short(value) {
  return value >= 10000 ? `${Math.round(value / 1000)}k` : String(Math.round(value));
}
