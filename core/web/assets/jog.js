// Jogging by hand: a key that is held is a dead man's key. While it is held this thread says so again and again, and the fine loop
// counts what comes; a page that hangs, is hidden or is gone says nothing more, and the machine stops by itself. A connection that
// stays open says nothing: browsers keep those of pages that hang. What is said again never begins a jog (`again`), so that a word
// that was on its way for too long finds the machine at rest and leaves it there.
import { machine } from "./machine.js";
import { element, say } from "./words.js";

const STEPS = [0.001, 0.01, 0.1, 1, 10];
const FEEDS = [10, 100, 300, 600, 1000, 3000, 6000, 15000];
const BEATS_PER_KEEP_ALIVE = 4;

let press = null;
let step = 0;
let feed = 600;

export function jogPanel() {
  const pad = element("div", { class: "pad", tabindex: "0", "aria-label": "Jog: arrow keys move X and Y, page up and page down Z" });
  const steps = element("div", { class: "steps", role: "group", "aria-label": "Step" });
  const select = element("select", { "aria-label": "Jog feed", onchange: () => { feed = Number(select.value); } });
  const home = element("div", { class: "pad homes" });
  const root = element("div", {},
    element("div", { class: "row" }, element("h2", { class: "grow" }, "Feed"), select),
    element("h2", {}, "Step in mm or deg; “held” moves while the key is held"), steps, pad,
    element("h2", {}, "Homing"), home,
    element("p", { class: "hint" }, "Keys: ← → X, ↑ ↓ Y, page up and down Z while this pad has the focus. Escape holds."));
  const chooseStep = (value) => {
    step = value;
    for (const button of steps.children) button.setAttribute("aria-pressed", String(Number(button.dataset.step) === step));
  };
  const all = [0, ...STEPS].map((value) => element("button", { "data-step": value, onclick: () => chooseStep(value) }, value ? String(value) : "held"));
  steps.style.gridTemplateColumns = "repeat(6, 1fr)";
  steps.replaceChildren(...all);
  chooseStep(0);
  machine.on("described", ({ axes }) => {
    const most = Math.max(...axes.map((axis) => axis.max_feed_per_min));
    const feeds = FEEDS.filter((value) => value <= most);
    feed = feeds.includes(feed) ? feed : feeds[feeds.length - 1];
    select.replaceChildren(...feeds.map((value) => element("option", { value, selected: value === feed }, `${value} /min`)));
    pad.replaceChildren(...padOf(axes));
    const homes = axes.filter((axis) => axis.homes);
    home.replaceChildren(...(homes.length ? homeButtons(homes) : [element("p", { class: "hint", style: "grid-column: 1 / 4" }, "The axes of this machine know where they are.")]));
  });
  machine.on("status", look);
  pad.addEventListener("keydown", (event) => {
    const [letter, direction] = KEYS[event.key] || [];
    if (!letter || !machine.described || !machine.axis(letter)) return;
    event.preventDefault();
    if (!event.repeat) begin(machine.axis(letter), direction, null);
  });
  pad.addEventListener("keyup", end);
  // Whatever may have taken the finger or the eye off the key ends the jog.
  window.addEventListener("blur", end);
  for (const name of ["pagehide", "contextmenu", "mouseup", "pointerup", "pointercancel", "touchend", "touchcancel"]) {
    window.addEventListener(name, end, true);
  }
  document.addEventListener("visibilitychange", end, true);
  document.addEventListener("pointermove", (event) => { if (press && press.button && event.buttons === 0) end(); }, true);
  return root;
}

const KEYS = {
  ArrowRight: ["x", 1], ArrowLeft: ["x", -1], ArrowUp: ["y", 1], ArrowDown: ["y", -1], PageUp: ["z", 1], PageDown: ["z", -1],
};

// X and Y as a cross with Z beside it, as the machine is seen from the front; further axes in rows.
function padOf(axes) {
  const has = (letter) => axes.find((axis) => axis.axis === letter);
  const key = (letter, direction) => {
    const axis = has(letter);
    return axis ? button(axis, direction) : element("span");
  };
  const cross = has("x") && has("y");
  const first = cross ? [element("span"), key("y", 1), key("z", 1), key("x", -1), element("span"), key("x", 1), element("span"), key("y", -1), key("z", -1)] : [];
  const rest = axes.filter((axis) => !cross || !"xyz".includes(axis.axis));
  return [...first, ...rest.flatMap((axis) => [button(axis, -1), element("span"), button(axis, 1)])];
}

function button(axis, direction) {
  const name = axis.axis.toUpperCase() + (direction > 0 ? "+" : "−");
  const node = element("button", { "data-jog": axis.axis + (direction > 0 ? "+" : "-"), style: `--key: var(--${axis.axis}, var(--ink))` }, name);
  node.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    node.setPointerCapture(event.pointerId);
    begin(axis, direction, node);
  });
  node.addEventListener("lostpointercapture", end);
  node.addEventListener("keydown", (event) => {
    if ((event.key === " " || event.key === "Enter") && !event.repeat) begin(axis, direction, node);
  });
  node.addEventListener("blur", end);
  return node;
}

function homeButtons(axes) {
  const ask = (keys) => () => {
    const why = machine.refusal("home");
    if (why) say(why); else machine.ask("home", keys);
  };
  const all = element("button", { style: "grid-column: 1 / 4", onclick: ask({}) }, "Home all");
  return [all, ...axes.map((axis) => element("button", { onclick: ask({ axis: axis.axis }) }, `Home ${axis.axis.toUpperCase()}`))];
}

function look() {
  const why = machine.refusal("jog");
  for (const node of document.querySelectorAll("[data-jog]")) node.setAttribute("aria-disabled", why && !press ? "true" : "false");
}

async function begin(axis, direction, node) {
  end();
  const why = machine.refusal("jog");
  if (why) { say(why); return; }
  const unhomed = machine.status.not_homed.includes(axis.axis);
  const most = Math.min(axis.max_feed_per_min, unhomed && axis.max_unhomed_feed_per_min || Infinity);
  const keys = { axis: axis.axis, [`feed_${axis.unit}_per_min`]: Math.min(feed, most) };
  if (step) {
    machine.ask("jog", { ...keys, [`distance_${axis.unit}`]: direction * step });
    return;
  }
  keys.direction = direction;
  const own = { keys, button: node, last: performance.now() };
  press = own;
  if (node) node.classList.add("moves");
  const keepAliveMs = machine.described.jog_keep_alive_s * 1000;
  own.timer = setInterval(() => beat(own, keepAliveMs), keepAliveMs / BEATS_PER_KEEP_ALIVE);
  try { await machine.link.ask("jog", keys); } catch (error) { say(error.message); if (press === own) end(); }
}

async function beat(own, keepAliveMs) {
  const now = performance.now();
  const late = now - own.last > keepAliveMs;
  own.last = now;
  // This thread was held up: the machine has stopped meanwhile, and only another press moves it.
  if (late || document.hidden) { end(); return; }
  try { await machine.link.ask("jog", { ...own.keys, again: true }); } catch { if (press === own) end(); }
}

// Ends the jog that this page has begun. The stop needs nobody's leave.
function end() {
  const own = press;
  if (!own) return;
  press = null;
  clearInterval(own.timer);
  if (own.button) own.button.classList.remove("moves");
  machine.link.ask("jog", { stop: true }).catch(() => { /* it has stopped already, or the beats that stay away stop it */ });
}
