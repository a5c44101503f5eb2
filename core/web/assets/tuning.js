// The integrator's bench: parameters of the policy script within their bounds, and what each run made of them: time, the jerk
// against its limit, and how far the corners stood off the path, beside the run before.
import { bind, machine } from "./machine.js";
import { element, say } from "./words.js";

const KEPT_RUNS = 20;

export function tuningPanel() {
  const rows = element("div", { class: "group" });
  const runs = element("tbody");
  let known = "", values = {}, declared = [], before = null;
  const fill = async () => {
    try { ({ parameters: values, declared } = await machine.link.ask("policy-parameters")); } catch (error) { say(error.message); return; }
    document.getElementById("tab-tuning").hidden = declared.length === 0;
    const now = declared.map(({ name }) => name).join();
    if (now !== known) { known = now; rows.replaceChildren(...declared.map(row)); }
    for (const of of declared) {
      const value = values[of.name] ?? of.default;
      const place = rows.querySelector(`[data-name="${of.name}"]`);
      place.querySelector("output").textContent = String(value);
      if (!place.contains(document.activeElement)) for (const input of place.querySelectorAll("input")) input.value = value;
    }
  };
  const set = async (name, value) => { if (await machine.ask("set-policy-parameter", { name, value })) fill(); };
  const row = ({ name, description, lowest, highest }) => {
    const range = { min: lowest, max: highest, step: "any", "aria-label": name };
    const number = element("input", { type: "number", ...range });
    const slider = element("input", { type: "range", ...range, step: (highest - lowest) / 200, "aria-label": `${name}, slider` });
    slider.addEventListener("input", () => { number.value = Number(Number(slider.value).toPrecision(4)); });
    number.addEventListener("input", () => { slider.value = number.value; });
    const button = bind(element("button", {}, "Set"), "set-policy-parameter", () => set(name, Number(number.value)));
    return element("div", { "data-name": name, class: "parameter" }, element("div", {}, element("b", {}, name), " ", element("output", {})),
      element("p", { class: "hint" }, `${description} (${lowest} to ${highest})`), slider, element("div", { class: "row" }, number, button));
  };
  machine.on("described", fill);
  machine.link.on("job", ({ job, summary }) => {
    if (job.job !== "program" || !summary || !Number.isFinite(summary.motion_time_s)) return;
    const jerk = Math.max(0, ...Object.values(summary.worst_of_limits || {}).map((of) => (of.jerk && of.jerk.share) || 0));
    const run = { time: summary.motion_time_s, jerk: jerk * 100, corner: summary.max_path_deviation_mm * 1000 };
    const cell = (key, digits, unit) => {
      const change = before ? run[key] - before[key] : 0;
      const words = before && Math.abs(change) >= 0.5 * 10 ** -digits ? `${change > 0 ? "+" : "−"}${Math.abs(change).toFixed(digits)}` : "";
      return element("td", {}, `${run[key].toFixed(digits)} ${unit}`, element("small", { class: "change" }, words));
    };
    const with_ = declared.map(({ name, default: usual }) => `${name} ${values[name] ?? usual}`).join(", ");
    runs.prepend(element("tr", { title: with_ }, element("td", {}, job.name), cell("time", 3, "s"), cell("jerk", 0, "%"), cell("corner", 1, "µm")),
      element("tr", { class: "with" }, element("td", { colspan: "4" }, with_)));
    before = run;
    while (runs.children.length > 2 * KEPT_RUNS) runs.lastChild.remove();
  });
  const head = element("thead", {}, element("tr", {}, ...["program", "time", "jerk of limit", "off path"].map((name) => element("th", {}, name))));
  return element("div", {}, element("h2", {}, "Parameters of the policy, from the next job on"), rows,
    element("h2", {}, "Runs since this page was opened, and the change"), element("div", { class: "wide" }, element("table", { id: "runs" }, head, runs)));
}
