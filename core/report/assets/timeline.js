// Time is chosen with the pointer: on any plot, on the strip that shows the whole run, or with the keys.

// The stretch being dragged over a plot: { from, to } in s.
let dragged = null;

function timeUnder(event, over) {
  const box = over.getBoundingClientRect();
  const part = (event.clientX - box.left) / box.width;
  return state.from + Math.min(Math.max(part, 0), 1) * (state.to - state.from);
}

function listenToTime(over) {
  over.addEventListener("wheel", (event) => wheelTime(event, over), { passive: false });
  over.addEventListener("dblclick", selectAllTime);
  over.addEventListener("pointerdown", (event) => dragTime(event, over));
  over.addEventListener("pointerleave", () => setCursor(null));
  over.addEventListener("pointermove", (event) => setCursor(nearestIndex(timeUnder(event, over))));
}

function wheelTime(event, over) {
  event.preventDefault();
  const sideways = event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY);
  const amount = event.deltaY || event.deltaX;
  if (sideways) moveTime((event.deltaX || event.deltaY) / 1000 * (state.to - state.from));
  else zoomTime(timeUnder(event, over), Math.exp(amount * 0.0015));
}

function dragTime(event, over) {
  const start = timeUnder(event, over), startX = event.clientX;
  const moving = event.shiftKey || event.button !== 0;
  drag(event, over, (move) => {
    const t = timeUnder(move, over);
    if (moving) return moveTime(start - t);
    dragged = Math.abs(move.clientX - startX) < 4 ? null : { from: Math.min(start, t), to: Math.max(start, t) };
    changed("look");
  }, () => {
    if (dragged) selectTime(dragged.from, dragged.to);
    dragged = null;
    changed("look");
  });
}

// Follows the pointer until it is let go, also outside of the element.
function drag(event, target, moved, done = () => {}) {
  event.preventDefault();
  target.setPointerCapture(event.pointerId);
  const end = () => {
    target.removeEventListener("pointermove", moved);
    done();
  };
  target.addEventListener("pointermove", moved);
  target.addEventListener("lostpointercapture", end, { once: true });
}

function listenToKeys() {
  document.addEventListener("keydown", (event) => {
    if (event.target.matches("input, select") || event.ctrlKey || event.metaKey || event.altKey) return;
    const span = state.to - state.from, middle = (state.to + state.from) / 2;
    const actions = {
      ArrowLeft: () => moveTime(-span / 8), ArrowRight: () => moveTime(span / 8),
      "+": () => zoomTime(middle, 0.7), "-": () => zoomTime(middle, 1 / 0.7), Escape: selectAllTime,
    };
    if (actions[event.key]) actions[event.key]();
  });
}

function timeTicks(width) {
  return ticks(state.from, state.to, width / 90);
}

function drawTimeAxis() {
  const { context, width } = prepare(document.getElementById("time-axis"));
  const inner = width - GUTTER.left - GUTTER.right;
  const places = timeTicks(inner);
  context.fillStyle = colour("soft");
  context.strokeStyle = colour("line");
  context.textBaseline = "top";
  context.textAlign = "center";
  tickLabels(places).forEach((label, k) => {
    const x = GUTTER.left + (places[k] - state.from) / (state.to - state.from) * inner;
    line(context, Math.round(x) + 0.5, 0, Math.round(x) + 0.5, 4);
    const half = context.measureText(label).width / 2;
    if (x - half > GUTTER.left - 4) context.fillText(label, Math.min(x, width - half - 2), 6);
  });
  context.textAlign = "right";
  context.fillText("time in s", GUTTER.left - 10, 6);
}

// The whole run in one strip: its feed, and the selected time as a window that can be dragged.
class Overview {
  constructor(place) {
    const feed = new Curve(columns.feed, null, { key: "whole run", label: "feed", colour: () => colour("faint"), range: () => [0, columns.t.length] });
    this.u = timePlot(place, {
      label: "overview of the run", times: columns.t, curves: [feed], fromZero: true,
      valueAxis: { splits: (u, _, low, high) => [(low + high) / 2], values: () => ["whole run"], grid: { show: false } },
      hooks: { draw: [(u) => this.drawWindow(u)] },
    });
    const { over } = this.u;
    over.addEventListener("pointerdown", (event) => this.dragWindow(event));
    over.addEventListener("wheel", (event) => wheelTime(event, over), { passive: false });
    over.addEventListener("dblclick", selectAllTime);
    new ResizeObserver(() => this.u.setSize({ width: place.clientWidth, height: place.clientHeight })).observe(place);
    this.u.setScale("x", { min: firstTime(), max: lastTime() });
  }

  dragWindow(event) {
    const { over } = this.u, box = over.getBoundingClientRect(), perPixel = (lastTime() - firstTime()) / box.width;
    const t = firstTime() + (event.clientX - box.left) * perPixel;
    if (t < state.from || t > state.to) moveTime(t - (state.from + state.to) / 2);
    let last = event.clientX;
    drag(event, over, (move) => {
      moveTime((move.clientX - last) * perPixel);
      last = move.clientX;
    });
  }

  draw() {
    this.u.redraw(false, true);
  }

  drawWindow({ ctx, bbox, valToPos }) {
    const { pxRatio } = uPlot;
    const from = valToPos(state.from, "x", true), to = Math.max(valToPos(state.to, "x", true), from + 2 * pxRatio);
    ctx.fillStyle = colour("select");
    ctx.fillRect(from, bbox.top, to - from, bbox.height);
    ctx.fillStyle = colour("accent");
    ctx.fillRect(from, bbox.top, 2 * pxRatio, bbox.height);
    ctx.fillRect(to - 2 * pxRatio, bbox.top, 2 * pxRatio, bbox.height);
  }
}
