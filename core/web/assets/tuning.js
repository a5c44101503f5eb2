// The integrator's bench: parameters of the policy script, and what the runs since took. Jerk and corners show in the scope.
import { bind, machine } from "./machine.js";
import { element, say } from "./words.js";

export function tuningPanel() {
  const rows = element("div", { class: "group" });
  const runs = element("tbody");
  let names = "";
  let values = {};
  const fill = async () => {
    if (!machine.knows("policy-parameters")) return;
    try { ({ parameters: values } = await machine.link.ask("policy-parameters")); } catch (error) { say(error.message); return; }
    const all = Object.keys(values);
    document.getElementById("tab-tuning").hidden = all.length === 0;
    if (all.join() === names) { all.forEach((name) => { rows.querySelector(`[data-name="${name}"] i`).textContent = String(values[name]); }); return; }
    names = all.join();
    rows.replaceChildren(...all.map((name) => {
      const input = element("input", { type: "number", step: "any", value: values[name], "aria-label": name });
      const set = bind(element("button", {}, "Set"), "set-policy-parameter", async () => {
        if (await machine.ask("set-policy-parameter", { name, value: Number(input.value) })) fill();
      });
      return element("div", { "data-name": name }, element("div", {}, name, " ", element("i", {}, String(values[name]))), element("div", { class: "row" }, input, set));
    }));
  };
  machine.on("described", fill);
  machine.link.on("job", ({ job }) => {
    if (job.job !== "program" || !Number.isFinite(job.time_s)) return;
    const with_ = Object.entries(values).map(([name, value]) => `${name} ${value}`).join(", ");
    runs.prepend(element("tr", {}, element("td", {}, job.name), element("td", {}, with_), element("td", {}, `${job.time_s.toFixed(3)} s`)));
    while (runs.children.length > 20) runs.lastChild.remove();
  });
  return element("div", {}, element("h2", {}, "Parameters of the policy, from the next job on"), rows,
    element("h2", {}, "Runs since this page was opened"), element("div", { class: "wide" }, element("table", {}, runs)));
}
