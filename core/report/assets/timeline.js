// Time is chosen with the pointer: on any plot, on the strip that shows the whole run, or with the keys.

// The stretch being dragged over a plot: { from, to } in s.
let dragged = null;

function timeUnder(event, canvas) {
  const width = canvas.clientWidth - GUTTER.left - GUTTER.right;
  const part = (event.clientX - canvas.getBoundingClientRect().left - GUTTER.left) / width;
  return state.from + Math.min(Math.max(part, 0), 1) * (state.to - state.from);
}

function listenToTime(canvas) {
  canvas.addEventListener("wheel", (event) => wheelTime(event, canvas), { passive: false });
  canvas.addEventListener("dblclick", selectAllTime);
  canvas.addEventListener("pointerdown", (event) => dragTime(event, canvas));
  canvas.addEventListener("pointerleave", () => setCursor(null));
  canvas.addEventListener("pointermove", (event) => setCursor(nearestIndex(timeUnder(event, canvas))));
}

function wheelTime(event, canvas) {
  event.preventDefault();
  const sideways = event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY);
  const amount = event.deltaY || event.deltaX;
  if (sideways) moveTime((event.deltaX || event.deltaY) / 1000 * (state.to - state.from));
  else zoomTime(timeUnder(event, canvas), Math.exp(amount * 0.0015));
}

function dragTime(event, canvas) {
  const start = timeUnder(event, canvas), startX = event.clientX;
  const moving = event.shiftKey || event.button !== 0;
  drag(event, canvas, (move) => {
    const t = timeUnder(move, canvas);
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

function drawTimeAxis() {
  const { context, width } = prepare(document.getElementById("time-axis"));
  const inner = width - GUTTER.left - GUTTER.right;
  const places = timeTicks(inner);
  context.fillStyle = theme.css.soft;
  context.strokeStyle = theme.css.line;
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
  constructor(canvas) {
    this.canvas = canvas;
    this.feed = new Extremes(columns.feed);
    canvas.addEventListener("pointerdown", (event) => this.dragWindow(event));
    canvas.addEventListener("wheel", (event) => wheelTime(event, canvas), { passive: false });
    canvas.addEventListener("dblclick", selectAllTime);
  }

  get perPixel() {
    return (lastTime() - firstTime()) / (this.canvas.clientWidth - GUTTER.left - GUTTER.right);
  }

  dragWindow(event) {
    const box = this.canvas.getBoundingClientRect();
    const t = firstTime() + (event.clientX - box.left - GUTTER.left) * this.perPixel;
    if (t < state.from || t > state.to) moveTime(t - (state.from + state.to) / 2);
    let last = event.clientX;
    drag(event, this.canvas, (move) => {
      moveTime((move.clientX - last) * this.perPixel);
      last = move.clientX;
    });
  }

  draw() {
    const { context, width, height } = prepare(this.canvas);
    const left = GUTTER.left, inner = width - left - GUTTER.right;
    const top = this.feed.of(0, columns.t.length)[1] || 1;
    context.fillStyle = theme.css.faint;
    for (let px = 0, i = 0; px < inner; px++) {
      const end = indexAt(firstTime() + (px + 1) * this.perPixel);
      const high = this.feed.of(i, Math.max(end, i + 1))[1];
      i = end;
      const tall = Math.max(high, 0) / top * (height - 8);
      if (tall > 0) context.fillRect(left + px, height - 3 - tall, 1, tall);
    }
    context.fillStyle = theme.css.soft;
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.fillText("whole run", left - 6, height / 2);
    this.drawWindow(context, height);
  }

  drawWindow(context, height) {
    const at = (t) => GUTTER.left + (t - firstTime()) / this.perPixel;
    const from = at(state.from), to = Math.max(at(state.to), from + 2);
    context.fillStyle = theme.css.select;
    context.fillRect(from, 0, to - from, height);
    context.fillStyle = theme.css.accent;
    context.fillRect(from, 0, 2, height);
    context.fillRect(to - 2, 0, 2, height);
  }
}
