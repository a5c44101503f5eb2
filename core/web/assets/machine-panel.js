// What the machine is: its limits, its plugins, its inputs and outputs.
import { machine, onFrame } from "./machine.js";
import { element, text } from "./words.js";

export function machinePanel() {
  const limits = element("table"), plugins = element("table"), wires = element("div", { class: "wires" });
  const bus = element("p", { id: "bus", hidden: "" });
  const states = new Map();
  machine.on("described", ({ axes, plugins: all, inputs, outputs }) => {
    const shown = (value) => (Number.isFinite(value) ? String(Math.round(value)).replace("-", "−") : "–");
    const head = (...names) => element("thead", {}, element("tr", {}, ...names.map((name) => element("th", {}, name))));
    limits.replaceChildren(head("", "travel", "/min", "/s²", "/s³"), element("tbody", {}, ...axes.map((axis) => element("tr", {},
      ...[`${axis.axis.toUpperCase()} ${axis.unit}`, `${shown(axis.min)}…${shown(axis.max)}`, shown(axis.max_feed_per_min), shown(axis.max_acceleration_per_s2), shown(axis.max_jerk_per_s3)]
        .map((words) => element("td", {}, words))))));
    plugins.replaceChildren(element("tbody", {}, ...(all || []).map(({ what, plugin }) => element("tr", {}, element("td", {}, what), element("td", { class: "name" }, plugin)))));
    states.clear();
    const wire = (kind, name) => {
      const state = element("b", {}, "–");
      states.set(kind + name, state);
      return element("span", { class: "wire" }, name, state);
    };
    const none = (kind) => element("span", { class: "hint" }, `This machine names no ${kind}.`);
    wires.replaceChildren(element("h2", {}, "Inputs"), ...(inputs.length ? inputs.map((name) => wire("inputs", name)) : [none("inputs")]),
      element("h2", {}, "Outputs"), ...(outputs.length ? outputs.map((name) => wire("outputs", name)) : [none("outputs")]));
  });
  machine.on("status", onFrame(() => {
    for (const kind of ["inputs", "outputs"]) {
      for (const [name, on] of Object.entries((machine.status || {})[kind] || {})) {
        const state = states.get(kind + name);
        if (!state) continue;
        text(state, on ? "on" : "off");
        state.parentNode.classList.toggle("on", Boolean(on));
      }
    }
    showBus(bus, (machine.status || {}).bus);
  }));
  return element("div", {}, bus, wires, element("h2", {}, "Limits"), element("div", { class: "wide" }, limits), element("h2", {}, "Plugins"), plugins);
}

// How well the drives are heard, where they are on a bus.
function showBus(line, bus) {
  line.hidden = !bus;
  if (!bus) return;
  const phase = Number.isFinite(bus.phase_us) ? `, phase ${bus.phase_us.toFixed(1)} µs` : "";
  text(line, `Bus: feedback ${bus.feedback_age_periods} periods old, late or lost in ${bus.old_feedback_periods} periods${phase}`);
  line.classList.toggle("warn", bus.feedback_age_periods > 0);
}
