// Lines by hand, with what became of each, and those before.
import { machine } from "./machine.js";
import { element, say } from "./words.js";

const REMEMBERED = 100;

export function mdiPanel() {
  const log = element("ul", { class: "log", tabindex: "0", "aria-label": "Lines before", style: "flex: 1" });
  const input = element("input", { type: "text", placeholder: "G0 X10 Y20", "aria-label": "Line by hand", autocomplete: "off", autocapitalize: "characters", spellcheck: "false" });
  const known = remembered();
  let place = known.length;
  const shown = new Map();
  const add = (line) => {
    const state = element("span", {}, "");
    log.append(element("li", { onclick: () => { input.value = line; input.focus(); } }, line, state));
    log.scrollTop = log.scrollHeight;
    return state;
  };
  known.slice(-30).forEach(add);
  const send = async () => {
    const line = input.value.trim();
    if (!line) return;
    const why = machine.refusal("mdi");
    if (why) { say(why); return; }
    input.value = "";
    known.push(line);
    localStorage.setItem("mdi", JSON.stringify(known.slice(-REMEMBERED)));
    place = known.length;
    const state = add(line);
    const answer = machine.link.ask("mdi", { line });
    shown.set(answer.id, state);
    state.textContent = "…";
    try { await answer; if (state.textContent === "…") state.textContent = "taken"; } catch (error) {
      state.textContent = "refused";
      log.append(element("li", { class: "bad" }, error.message));
      log.scrollTop = log.scrollHeight;
      input.value = line;
    }
  };
  input.addEventListener("keydown", (event) => {
    if (event.key === "Enter") { event.preventDefault(); send(); }
    if (event.key !== "ArrowUp" && event.key !== "ArrowDown") return;
    event.preventDefault();
    place = Math.min(Math.max(place + (event.key === "ArrowUp" ? -1 : 1), 0), known.length);
    input.value = known[place] || "";
  });
  for (const [event, words] of [["driven", "driven"], ["not-driven", "not driven"]]) {
    machine.link.on(event, ({ id }) => { const state = shown.get(id); if (state) { state.textContent = words; shown.delete(id); } });
  }
  return element("div", {}, log,
    element("div", { class: "row" }, input, element("button", { class: "primary", onclick: send }, "Send")),
    element("p", { class: "hint" }, "Enter sends; ↑ and ↓ bring lines back. Lines that come in time are driven through."));
}

function remembered() {
  try { const known = JSON.parse(localStorage.getItem("mdi")); return Array.isArray(known) ? known : []; } catch { return []; }
}
