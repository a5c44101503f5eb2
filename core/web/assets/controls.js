// What is always at hand: state, next step, control, start, hold, abort, switches, overrides, the software stop.
import { bind, machine, onFrame, setLease } from "./machine.js";
import { STATES, fixed, nextStep, say, shownState, text } from "./words.js";

const at = (id) => document.getElementById(id);
let step = null;
let stranger = false;
// Overrides that are being turned: what the controller tells of them meanwhile is old.
const turned = new Map();

export function controls() {
  machine.on("status", onFrame(draw));
  machine.on("described", ({ machine: name, max_feed_ratio }) => {
    text("machine-name", name);
    document.title = name;
    at("feed-override").max = Math.round(max_feed_ratio * 100);
  });
  machine.link.on("stranger", () => { stranger = true; draw(); });
  machine.link.on("greeting", () => { stranger = false; });
  machine.link.on("echo", (ms) => text("echo", ms < 1 ? "< 1 ms" : `${Math.round(ms)} ms`));
  machine.link.on("away", () => text("echo", "–"));
  machine.link.on("refused", ({ why }) => say(why));
  machine.link.on("waits", ({ line }) => say(`The program waits at line ${line}.`));
  at("lease").addEventListener("click", () => {
    const why = machine.mayAsk("lease") ? null : machine.refusal("lease");
    if (why) say(why); else lease();
  });
  at("alarms").addEventListener("click", () => document.getElementById("tab-history").click());
  at("theme").addEventListener("click", () => {
    useTheme(theme.name === "dark" ? "light" : "dark");
    localStorage.setItem("theme", theme.name);
    machine.tell("theme");
  });
  at("next-action").addEventListener("click", act);
  // One button begins and goes on: what it would do stands on it.
  at("start").addEventListener("click", () => {
    const why = startRefusal();
    if (why) say(why); else machine.ask(startRequest());
  });
  for (const request of ["hold", "abort"]) bind(at(request), request, () => machine.ask(request));
  at("stop").addEventListener("click", () => machine.ask("emergency-stop"));
  for (const request of ["single-block", "optional-stop", "block-delete"]) {
    bind(at(request), request, () => machine.ask(request, { on: at(request).getAttribute("aria-pressed") !== "true" }));
  }
  for (const request of ["feed-override", "rapid-override"]) override(at(request), request);
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && machine.status && !machine.refusal("hold")) machine.ask("hold");
  });
}

function startRequest() {
  return machine.status && machine.status.state === "held" ? "resume" : "start";
}

// Why the button does nothing now; null where it does.
function startRefusal() {
  const isMissing = startRequest() === "start" && machine.status && !machine.status.program;
  return machine.refusal(startRequest()) || (isMissing ? "No program is loaded: choose one under Programs." : null);
}

async function act() {
  if (!step) return;
  if (!machine.hasLease && !(await take(false))) return;
  machine.ask(step);
}

async function lease() {
  if (machine.hasLease) {
    if (await machine.ask("lease", { how: "release" })) setLease(false);
    return;
  }
  await take(at("lease").dataset.how === "take-over");
}

async function take(over) {
  try {
    await machine.link.ask("lease", { how: over ? "take-over" : "take" });
    at("lease").dataset.how = "take";
    setLease(true);
    return true;
  } catch (error) {
    // Who has it is asked whether it is there; a second press takes it.
    at("lease").dataset.how = "take-over";
    say(`${error.message[0].toUpperCase()}${error.message.slice(1)}.`);
    draw();
    return false;
  }
}

function override(slider, request) {
  let waiting = false;
  const send = async () => {
    if (waiting) return;
    waiting = true;
    await machine.ask(request, { ratio: Number(slider.value) / 100 });
    waiting = false;
    if (turned.get(request) !== undefined && turned.get(request) !== slider.value) { turned.set(request, slider.value); send(); }
  };
  slider.addEventListener("input", () => { turned.set(request, slider.value); send(); draw(); });
  slider.addEventListener("change", () => setTimeout(() => turned.delete(request), 300));
}

function draw() {
  const { status } = machine;
  const shown = shownState(status), state = status ? status.state : "away";
  const [word, mark, mood] = STATES[shown] || [shown, "?", "waits"];
  const body = document.body;
  if (body.dataset.state !== state) body.dataset.state = state;
  if (body.dataset.mood !== mood) body.dataset.mood = mood;
  text("state", word);
  text("state-mark", mark);
  const strangerWords = "This address has no valid token: open the one that tandem serve has printed last.";
  const [words, label, request] = status ? nextStep(status, machine.described, machine.hasLease || !machine.mayAsk("lease"))
    : [stranger ? strangerWords : "The controller does not answer. Trying again; nothing is sent meanwhile."];
  text("next", words || "");
  step = request && machine.mayAsk(request) ? request : null;
  at("next-action").hidden = !step;
  if (step) text("next-action", machine.hasLease ? label : `Take control · ${label}`);
  const mayControl = machine.mayAsk("lease");
  // What comes first for whoever opens the page, where no other button offers it.
  at("lease").classList.toggle("primary", Boolean(status) && !status.job && mayControl && !machine.hasLease && !step);
  at("lease").setAttribute("aria-disabled", String(!mayControl));
  const alarms = status ? status.alarms.length : 0;
  at("alarms").classList.toggle("none", alarms === 0);
  text("alarms", alarms === 1 ? "1 alarm" : `${alarms} alarms`);
  text("lease", !mayControl ? "Looks on" : machine.hasLease ? "In control" : at("lease").dataset.how === "take-over" ? "Take it over" : "Take control");
  at("lease").title = !mayControl ? machine.refusal("lease") : machine.hasLease ? "Press to give control back" : "One page controls the machine, all others look";
  const idle = startRefusal();
  at("start").setAttribute("aria-disabled", idle ? "true" : "false");
  at("start").title = idle || "";
  text("start", startRequest() === "resume" ? "Resume" : "Start");
  const why = machine.refusal("feed-override");
  for (const [id, ratio, shown] of [["feed-override", "feed_override", "feed-ratio"], ["rapid-override", "rapid_override", "rapid-ratio"]]) {
    const slider = at(id);
    slider.disabled = Boolean(why);
    const percent = turned.get(id) ?? (status ? String(Math.round(status[ratio] * 100)) : slider.value);
    if (slider.value !== percent) slider.value = percent;
    text(shown, `${percent} %`);
  }
  if (!status) return;
  for (const [id, on] of [["single-block", status.single_block], ["optional-stop", status.optional_stop], ["block-delete", status.block_delete]]) {
    at(id).setAttribute("aria-pressed", String(Boolean(on)));
  }
  text("job", status.job === "program" || !status.job ? status.program || "No program" : word);
  text("line", status.job === "program" && status.line ? `line ${status.line}` : "");
  text("share", status.job === "program" ? `${fixed(status.progress * 100, 0)} %` : "");
  at("progress").style.transform = `scaleX(${status.job === "program" ? status.progress : 0})`;
}
