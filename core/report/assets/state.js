// What all drawings share: the selected time, the cursor, what is hidden, the unit of feeds.
const state = { from: 0, to: 1, cursor: null, hidden: new Set(), perMinute: true };

const listeners = { window: [], cursor: [], look: [] };
let pending = new Set();

function on(kinds, listener) {
  for (const kind of kinds.split(" ")) listeners[kind].push(listener);
}

// Drawings are redrawn once per frame, however many events ask for it.
function changed(kind) {
  if (pending.size === 0) requestAnimationFrame(redraw);
  pending.add(kind);
}

function redraw() {
  const kinds = pending;
  pending = new Set();
  const due = new Set([...kinds].flatMap((kind) => listeners[kind]));
  for (const listener of due) listener(kinds);
}

function firstTime() {
  return columns.t[0];
}

function lastTime() {
  return Math.max(columns.t[columns.t.length - 1], firstTime() + 1e-3);
}

function selectTime(from, to) {
  const least = Math.min(4e-3, lastTime() - firstTime());
  const span = Math.min(Math.max(to - from, least), lastTime() - firstTime());
  const middle = (from + to) / 2;
  state.from = Math.min(Math.max(middle - span / 2, firstTime()), lastTime() - span);
  state.to = state.from + span;
  changed("window");
  rememberTime();
}

function selectAllTime() {
  selectTime(firstTime(), lastTime());
}

function allTimeSelected() {
  return state.to - state.from >= (lastTime() - firstTime()) * 0.9999;
}

function zoomTime(t, factor) {
  selectTime(t - (t - state.from) * factor, t + (state.to - t) * factor);
}

function moveTime(by) {
  selectTime(state.from + by, state.to + by);
}

function setCursor(i) {
  if (i === state.cursor) return;
  state.cursor = i;
  changed("cursor");
}

function toggle(key) {
  if (!state.hidden.delete(key)) state.hidden.add(key);
  changed("look");
}

// The address carries the selected time, so that a link shows a colleague the same place.
let remembering = null;

function rememberTime() {
  clearTimeout(remembering);
  remembering = setTimeout(() => {
    const options = new URLSearchParams(location.hash.slice(1));
    options.delete("t");
    if (!allTimeSelected()) options.set("t", `${state.from.toFixed(4)},${state.to.toFixed(4)}`);
    const hash = options.toString().replace(/%2C/g, ",");
    history.replaceState(null, "", hash ? "#" + hash : "#");
  }, 300);
}

function restoreTime() {
  const wanted = new URLSearchParams(location.hash.slice(1)).get("t");
  const [from, to] = (wanted || "").split(",").map(Number);
  if (to > from) selectTime(from, to); else selectAllTime();
}
