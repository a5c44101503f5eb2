// Work offsets with touch-off, tools, and what was driven.
import { bind, machine } from "./machine.js";
import { element, fixed, say } from "./words.js";

const read = async (fill) => {
  try { fill(await machine.link.ask("tables")); } catch (error) { say(error.message); }
};

export function offsetsPanel() {
  const touch = element("div", { class: "group" });
  const table = element("table");
  let system = null;
  const fill = ({ offsets }) => {
    const axes = machine.described.axes;
    const active = machine.status ? machine.status.system : "";
    const head = element("thead", {}, element("tr", {}, ...["", ...axes.map((axis) => axis.axis.toUpperCase())].map((name) => element("th", {}, name))));
    const rows = Object.entries(offsets).map(([name, origin]) => element("tr", { class: name === active ? "active" : null },
      element("td", {}, name), ...axes.map((axis) => element("td", {}, fixed(origin[machine.key(axis)])))));
    table.replaceChildren(head, element("tbody", {}, ...rows));
  };
  const set = async (keys) => { if (await machine.ask("touch-off", keys)) read(fill); };
  machine.on("described", ({ axes }) => {
    const inputs = axes.map((axis) => {
      const input = element("input", { type: "number", step: "any", value: "0", "aria-label": `${axis.axis.toUpperCase()} is`, style: "width: 90px" });
      const button = bind(element("button", {}, `Set ${axis.axis.toUpperCase()}`), "touch-off", () => set({ [machine.key(axis)]: Number(input.value) }));
      return element("div", { class: "row" }, element("b", { style: `color: var(--${axis.axis}, var(--ink)); width: 22px` }, axis.axis.toUpperCase()), element("i", {}, "is"), input, element("small", {}, axis.unit), button);
    });
    const zero = bind(element("button", {}, "All are zero here"), "touch-off", () => set(Object.fromEntries(axes.map((axis) => [machine.key(axis), 0]))));
    touch.replaceChildren(...inputs, zero);
    read(fill);
  });
  machine.on("status", (status) => {
    if (status && status.system !== system) { system = status.system; read(fill); }
  });
  machine.link.on("job", () => read(fill));
  return element("div", {}, element("h2", {}, "Touch off: where the machine stands is called"), touch,
    element("h2", {}, "Origins, machine coordinates"), element("div", { class: "wide" }, table));
}

export function toolsPanel() {
  const table = element("table");
  const number = element("input", { type: "number", min: "1", step: "1", "aria-label": "Tool number" });
  const length = element("input", { type: "number", step: "any", "aria-label": "Length offset in mm" });
  const diameter = element("input", { type: "number", step: "any", "aria-label": "Diameter in mm" });
  const fill = ({ tools }) => {
    const inSpindle = machine.status ? machine.status.tool : 0;
    const row = (tool) => {
      const load = bind(element("button", {}, tool.number === inSpindle ? "in spindle" : "insert"), "set-tool", async () => {
        if (await machine.ask("set-tool", { number: tool.number, in_spindle: true })) read(fill);
      });
      return element("tr", { class: tool.number === inSpindle ? "active" : null }, element("td", {}, `T${tool.number}`),
        element("td", {}, fixed(tool.offset.z_mm)), element("td", {}, fixed(tool.diameter_mm)), element("td", {}, load));
    };
    const body = tools.length ? tools.map(row) : [element("tr", {}, element("td", { colspan: "4" }, "There are none yet."))];
    table.replaceChildren(element("thead", {}, element("tr", {}, ...["", "length", "⌀", ""].map((name) => element("th", {}, name)))), element("tbody", {}, ...body));
  };
  const set = bind(element("button", { class: "primary" }, "Set"), "set-tool", async () => {
    if (!number.value) { say("A tool has a number."); return; }
    const keys = { number: Number(number.value) };
    if (length.value) keys.z_mm = Number(length.value);
    if (diameter.value) keys.diameter_mm = Number(diameter.value);
    if (await machine.ask("set-tool", keys)) { number.value = length.value = diameter.value = ""; read(fill); }
  });
  let tool = null;
  machine.on("described", () => read(fill));
  machine.on("status", (status) => { if (status && status.tool !== tool) { tool = status.tool; read(fill); } });
  return element("div", {}, element("div", { class: "wide" }, table), element("h2", {}, "A tool"),
    element("div", { class: "fields" }, ...[["Number", number], ["Length mm", length], ["Diameter mm", diameter]].map(([name, input]) => element("label", {}, name, input))), set);
}

export function historyPanel() {
  const list = element("ul", { class: "files" });
  const alarms = element("ul", { class: "alarms" });
  const all = bind(element("button", { hidden: "" }, "Acknowledge all"), "acknowledge", () => machine.ask("acknowledge", {}));
  const fill = async () => {
    try {
      const told = await machine.link.ask("history", { count: 10 });
      list.replaceChildren(...(told.jobs.length ? told.jobs.map(job) : [element("li", { class: "hint" }, "Nothing was driven yet.")]));
      alarms.replaceChildren(...(told.alarms.length ? told.alarms.map(alarmRow) : [element("li", { class: "hint" }, "There were none.")]));
      all.hidden = !told.alarms.some((alarm) => alarm.acknowledged_unix_ms === null);
    } catch (error) { say(error.message); }
  };
  machine.on("described", fill);
  machine.link.on("job", fill);
  machine.link.on("state", fill);
  machine.link.on("alarm", fill);
  return element("div", {}, element("h2", {}, "Alarms"), alarms, all, element("h2", {}, "Jobs"), list);
}

// An alarm stays until somebody says that it was seen; a reset does not say so.
function alarmRow({ alarm, text, raised_unix_ms: raised, acknowledged_unix_ms: seen }) {
  const when = element("small", {}, new Date(raised).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" }));
  if (seen !== null) return element("li", { class: "seen" }, when, element("span", {}, text));
  const button = bind(element("button", {}, "Acknowledge"), "acknowledge", () => machine.ask("acknowledge", { alarm }));
  return element("li", {}, when, element("span", {}, text), button);
}

function job({ name, outcome, time_s, stops }) {
  const time = Number.isFinite(time_s) ? `${time_s.toFixed(1)} s` : "";
  const words = outcome === "done" ? "" : outcome ? outcome.replace("-", " ") : "is driven";
  const facts = [words, stops === 1 ? "1 stop" : stops ? `${stops} stops` : ""].filter(Boolean).join(", ");
  const row = element("li", { class: "job" }, element("span", { class: "name" }, name), element("small", {}, time));
  if (facts) row.append(element("small", { class: ["fault", "emergency-stop", "lost"].includes(outcome) ? "bad" : null }, facts));
  return row;
}
