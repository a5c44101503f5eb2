// States as the operator reads them: a word, a mark that needs no colour, a mood, and what to do next.
export const STATES = {
  "away": ["No connection", "⌁", "stopped"],
  "emergency-stop": ["Stopped", "■", "stopped"],
  "disabled": ["Drives off", "○", "waits"],
  "homing-needed": ["Homing needed", "⌂", "waits"],
  "ready": ["Ready", "●", "ready"],
  "manual": ["Jogging", "✥", "moves"],
  "mdi": ["Manual line", "▶", "moves"],
  "running": ["Running", "▶", "moves"],
  "held": ["Held", "❚❚", "waits"],
  "slowing": ["Holding", "❚❚", "waits"],
  "stopping": ["Stopping", "…", "waits"],
  "fault": ["Fault", "!", "stopped"],
};

// The state as it is shown: a machine that is held is so once it stands.
export function shownState(status) {
  if (!status) return "away";
  return status.state === "held" && !status.at_rest ? "slowing" : status.state;
}

// What the operator can do next: words, and the request behind the button.
export function nextStep(status, described, hasLease) {
  const { state } = status;
  if (status.enabling) return ["The drives are being enabled: " + status.enabling];
  switch (state) {
    case "emergency-stop":
      return ["A software stop has acted. Put right what was wrong, then reset.", "Reset", "reset"];
    case "fault":
      return [adviceOn(status.fault), "Reset", "reset"];
    case "disabled":
      return ["The drives do not hold. Enable them when nobody is in the machine.", "Enable drives", "enable"];
    case "homing-needed": {
      const axes = status.not_homed.join(", ").toUpperCase();
      return [axes ? `It is not known where ${axes} ${status.not_homed.length > 1 ? "stand" : "stands"}.` : "The machine is to be homed first.", "Home all", "home"];
    }
    case "held":
      if (!status.at_rest) return ["The machine comes to rest on the path.", "Resume", "resume"];
      if (status.waits_on_line !== null) return [`The program waits at line ${status.waits_on_line}.`, "Resume", "resume"];
      return [status.held_by ? `Held by ${status.held_by}: release it, then resume.` : "Feed hold: the machine stands on the path.", "Resume", "resume"];
    case "running":
      if (status.feed_override === 0) return ["The feed override is at 0 %: nothing moves."];
      return [status.waits_for ? "Waits for " + status.waits_for : status.job === "home" ? "The axes look for their switches." : `${status.program || "Program"}, line ${status.line}`];
    case "stopping":
      return ["The machine comes to rest."];
    case "manual":
      return ["Moves as long as the key is held."];
    case "mdi":
      return ["Lines by hand are driven as they come."];
    case "ready":
      if (status.program) return [`${status.program} is loaded.`, "Start", "start"];
      return [!described ? "" : hasLease ? "Choose a program, jog, or type a line." : "This page looks on. Take control to choose a program, jog, or type a line."];
    default:
      return [""];
  }
}

// The controller's own words, and what usually helps, found by what they speak of.
const ADVICE = [
  [/following/i, "Look for a blocked axis or a drive that is too weak, then reset."],
  [/guard|limit/i, "The axes were stopped before the limit was passed. Reset, then jog away from it."],
  [/missed|late|starv/i, "The computer had no time for the fine loop: close what loads it, then reset."],
  [/watchdog|exchange|driver|bus/i, "Look at the cable and the supply of the drives, then reset."],
  [/switch|homing/i, "Look at the switch of the axis, then reset and home again."],
  [/probe/i, "Look at the probe and its cable, then reset."],
];

export function adviceOn(fault) {
  const words = fault || "The machine has stopped by itself.";
  const advice = ADVICE.find(([speaksOf]) => speaksOf.test(words));
  const said = /[.!?]$/.test(words) ? words : words + ".";
  return `${said} ${advice ? advice[1] : "Put right what was wrong, then reset."}`;
}

export function text(id, words) {
  const node = typeof id === "string" ? document.getElementById(id) : id;
  // Setting what is there already would still cost the browser a layout.
  if (node.textContent !== words) node.textContent = words;
}

export function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

// A number of fixed width, so that nothing moves when it changes; the minus is as wide as the plus.
export function fixed(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const rounded = Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value;
  return rounded.toFixed(digits).replace("-", "−");
}

let gone;
export function say(words) {
  const place = document.getElementById("says");
  place.replaceChildren(element("div", {}, words));
  clearTimeout(gone);
  gone = setTimeout(() => place.replaceChildren(), 6000);
}
