// Which signals the scope plots, and a capture of every sample around the instant of a trigger.
import { MAX_SIGNALS, chooseSignals, chosenSignals, showCapture, signalsInForce, signalsOf } from "./scope.js";
import { machine } from "./machine.js";
import { element, say } from "./words.js";

export function capturePanel() {
  const list = element("div", { class: "checks", role: "group", "aria-label": "Signals" });
  const when = element("select", { "aria-label": "Signal of the trigger" });
  const side = element("select", { "aria-label": "Side of the level" }, element("option", { value: "above" }, "above"), element("option", { value: "below" }, "below"));
  const number = (label, value) => element("input", { type: "number", step: "any", value, "aria-label": label });
  const [level, before, after] = [number("Level", 0), number("Seconds before", 0.2), number("Seconds after", 0.5)];
  const words = element("p", { class: "hint", role: "status" }, "Nothing is armed.");
  const arm = async () => {
    const keys = { signals: signalsInForce(), before_s: Number(before.value), after_s: Number(after.value) };
    if (when.value) Object.assign(keys, { when: when.value, [side.value]: Number(level.value) });
    try {
      await machine.link.ask("capture", keys);
      words.textContent = when.value ? `Armed: waits until ${when.value} goes ${side.value} ${level.value}.` : "Armed: from the next motion on.";
    } catch (error) { say(error.message); }
  };
  machine.on("described", (described) => {
    const all = signalsOf(described);
    const boxes = all.map((name) => {
      const box = element("input", { type: "checkbox", value: name });
      box.checked = chosenSignals().includes(name);
      return element("label", {}, box, name);
    });
    list.replaceChildren(...boxes);
    when.replaceChildren(element("option", { value: "" }, "at once"), ...all.map((name) => element("option", { value: name }, name)));
  });
  list.addEventListener("change", (event) => {
    const names = [...list.querySelectorAll(":checked")].map((box) => box.value);
    if (names.length > MAX_SIGNALS) {
      event.target.checked = false;
      say(`The scope plots at most ${MAX_SIGNALS} signals.`);
      return;
    }
    chooseSignals(names);
  });
  machine.link.on("captured", async (told) => {
    try {
      const rows = [];
      while (rows.length < told.count) {
        const part = await machine.link.ask("captured", { from: rows.length });
        if (part.rows.length === 0) break;
        rows.push(...part.rows);
      }
      showCapture({ ...told, rows });
      words.textContent = `Captured: ${rows.length} samples, the trigger is at 0 s. "Captured" beside the plot goes back to what comes.`;
    } catch (error) { say(error.message); }
  });
  return element("div", {}, element("h2", {}, `Signals, at most ${MAX_SIGNALS}`), list, element("h2", {}, "Capture every sample around"),
    element("div", { class: "row" }, when, side, level),
    element("div", { class: "row" }, element("small", {}, "s before"), before, element("small", {}, "after"), after, element("button", { class: "primary", onclick: arm }, "Arm")),
    words);
}
