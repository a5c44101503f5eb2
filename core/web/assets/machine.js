// What every part of the page shares: the connection, what the machine is, how it is now, and who may ask for what.
import { Link } from "./link.js";
import { say } from "./words.js";

const STATUS_RATE_HZ = 25;
// What a token allows, each what those before it allow.
const ROLES = ["watch", "operate", "set-up"];
// Requests that need no control lease.
const FREE = new Set(["hold", "emergency-stop", "jog-stop"]);

export const machine = {
  link: null,
  described: null,
  status: null,
  hasLease: false,
  role: "set-up",
  listeners: { described: [], status: [], theme: [] },

  on(what, listener) { this.listeners[what].push(listener); },
  tell(what, told) { for (const listener of this.listeners[what]) listener(told); },

  // Whether the token of this page allows a request at all.
  mayAsk(request) {
    const needed = this.described && this.described.roles ? this.described.roles[request] : null;
    return !needed || ROLES.indexOf(this.role) >= ROLES.indexOf(needed);
  },

  // Why a request would be refused now; null where it would not.
  refusal(request) {
    if (!this.link || !this.link.isOpen || !this.described) return "There is no connection to the controller.";
    if (!this.mayAsk(request)) return this.role === "watch" ? "The token of this page lets it look, hold and stop, and nothing else." : "The token of this page does not let it change what lasts.";
    if (!FREE.has(request) && !this.hasLease) return "Take control first.";
    const why = (this.described.refused[this.status ? this.status.state : ""] || {})[request];
    return why ? why[0].toUpperCase() + why.slice(1) + "." : null;
  },

  // Asks, and says what was refused; null then.
  async ask(request, keys) {
    try { return await this.link.ask(request, keys); } catch (error) { say(error.message); return null; }
  },

  axis(letter) {
    return this.described.axes.find((axis) => axis.axis === letter);
  },

  // The key of an axis in positions, as in x_mm.
  key(axis) { return `${axis.axis}_${axis.unit}`; },
};

// The token comes behind # of the address, and is kept for this server alone; it does not stay in the address.
function token() {
  const options = new URLSearchParams(location.hash.slice(1));
  const given = options.get("token");
  if (given) {
    localStorage.setItem("token", given);
    options.delete("token");
    history.replaceState(null, "", location.pathname + (options.size ? "#" + options : ""));
  }
  return localStorage.getItem("token") || "";
}

export function connect() {
  const link = new Link(token());
  machine.link = link;
  link.on("greeting", async ({ role }) => {
    machine.role = ROLES.includes(role) ? role : "set-up";
    try {
      // Asked together: what is true stands here after one answer's way.
      const [described, status] = await Promise.all([link.ask("machine"), link.ask("status"), link.ask("subscribe", { rate_hz: STATUS_RATE_HZ })]);
      machine.described = described;
      machine.tell("described", described);
      if (!machine.status) show(status);
    } catch (error) { say(error.message); }
  });
  link.on("status", ({ status, lost }) => { show(status); if (lost) machine.lost = (machine.lost || 0) + lost; });
  link.on("state", async () => { try { show(await link.ask("status")); } catch { /* told elsewhere */ } });
  link.on("lease", (told) => {
    if (told.lost_to) { setLease(false); say(`Client ${told.lost_to} has taken control.`); }
    if (told.asked_by) say(`Client ${told.asked_by} asks for control.`);
  });
  link.on("away", () => { setLease(false); machine.status = null; machine.tell("status", null); });
  link.open();
}

export function setLease(has) {
  machine.hasLease = has;
  document.body.classList.toggle("held-by-me", has);
  machine.tell("status", machine.status);
}

function show(status) {
  machine.status = status;
  machine.tell("status", status);
}

// A button that is bound to a request: where it would be refused it says why, and keeps the keyboard's place.
export function bind(button, request, act) {
  button.addEventListener("click", () => {
    const why = machine.refusal(request);
    if (why) say(why); else act();
  });
  const look = () => {
    const why = machine.refusal(request);
    const disabled = why ? "true" : "false";
    if (button.getAttribute("aria-disabled") !== disabled) button.setAttribute("aria-disabled", disabled);
    const title = why || button.dataset.title || "";
    if (button.title !== title) button.title = title;
  };
  button.dataset.title = button.title;
  machine.on("status", look);
  look();
  return button;
}

// Whatever is drawn is drawn once a frame, however often it is told.
export function onFrame(draw) {
  let pending = false;
  return () => {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => { pending = false; draw(); });
  };
}
