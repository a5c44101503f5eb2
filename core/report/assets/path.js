// The path as it was driven, coloured by a quantity; what lies outside of the selected time is faint.
const FAINT = SHADES;
const WIDTH = 1.8;

// The axes that span the path: X, Y and Z where the machine has them, else its first ones.
function spaceAxes() {
  const named = ["X", "Y", "Z"].map((letter) => about.axes.findIndex((axis) => axis.letter === letter && axis.linear));
  return named.some((i) => i >= 0) ? named : [0, 1, 2].map((i) => (i < about.axes.length ? i : -1));
}

class PathView {
  // Three canvases on each other: the ground, the lines, and what stands above them, which also takes the pointer.
  constructor(ground, canvas, over) {
    Object.assign(this, { ground, over, lines: new Lines(canvas), camera: new Camera(), made: "" });
    this.space = spaceAxes();
    this.points = this.space.map((axis) => (axis < 0 ? new Float32Array(columns.t.length) : columns["position" + axis]));
    this.names = this.space.map((axis, place) => (axis < 0 ? "XYZ"[place] : about.axes[axis].letter));
    this.origin = this.space.map((axis) => (axis < 0 ? 0 : about.axes[axis].centre));
    this.sources = this.colourSources();
    this.source = this.sources[0];
    this.hits = hitsOf(anyMarks(), 255);
    this.listen();
  }

  colourSources() {
    const feed = { name: "path feed", values: columns.feed, scale: feedScale, unit: feedUnit };
    const sources = [feed];
    const plain = (name, column, unit) => {
      if (columns[column]) sources.push({ name, values: columns[column], scale: () => 1, unit: () => unit });
    };
    plain("path deviation", "deviation", "mm");
    plain("σ", "sigma", "");
    about.signals.forEach((signal, k) => plain(signal.name, "signal" + k, signal.unit));
    return sources;
  }

  show(name) {
    this.camera.show(name);
    this.fit(0, columns.t.length);
  }

  measure() {
    [this.camera.width, this.camera.height] = [this.over.clientWidth, this.over.clientHeight];
  }

  fit(from, to) {
    this.fitted = [from, to];
    const step = Math.max(1, Math.floor((to - from) / 100000));
    const ends = { u0: Infinity, u1: -Infinity, v0: Infinity, v1: -Infinity };
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let i = from; i < to; i += step) {
      const point = this.points.map((values) => values[i]);
      this.camera.widen(ends, point);
      point.forEach((value, axis) => {
        low[axis] = Math.min(low[axis], value);
        high[axis] = Math.max(high[axis], value);
      });
    }
    this.measure();
    if (to > from) this.camera.frame(ends, low.map((value, axis) => (value + high[axis]) / 2));
    changed("look");
  }

  screen(i) {
    const [x, y, z] = this.points;
    return this.camera.screen([x[i], y[i], z[i]]);
  }

  draw() {
    const { width, height } = this.camera;
    this.measure();
    // What is fitted stays so while the view takes its size, as when the page comes up.
    if (this.fitted && (width !== this.camera.width || height !== this.camera.height)) this.fit(...this.fitted);
    const [from, to] = selectedRange();
    const [low, high] = rangeOf(this.source);
    const key = [from, to, low, high, this.source.name].join();
    if (key !== this.made) this.make(from, to, low, high);
    this.made = key;
    const ground = prepare(this.ground).context;
    if (this.camera.isPlane) drawGrid(ground, this.camera, this.names, this.origin);
    const colours = [...shades().map((shade) => [...shade.map((part) => part / 255), 1]), [...rgba(colour("faint")).slice(0, 3), 0.5]];
    this.lines.draw(this.camera.view(), colours, WIDTH, this.isMoving);
    const { context } = prepare(this.over);
    this.drawHits(context, from, to);
    if (state.cursor !== null) drawPlace(context, this.screen(state.cursor));
    this.drawLegend(context, low, high);
    if (!this.camera.isPlane) drawTriad(context, this.camera, this.names);
    drawScaleBar(context, this.camera);
  }

  // The lines anew: first what lies outside of the selected time.
  make(from, to, low, high) {
    this.lines.clear();
    const n = columns.t.length;
    if (from > 0) this.add(0, from + 1, () => FAINT);
    if (to < n) this.add(to - 1, n, () => FAINT);
    this.add(from, to, (i) => shadeOf(this.source.values[i], low, high));
  }

  add(from, to, shade) {
    const [x, y, z] = this.points, points = new Float32Array(Math.max(to - from, 0) * 4);
    for (let i = from, at = 0; i < to; i++, at += 4) {
      points[at] = x[i];
      points[at + 1] = y[i];
      points[at + 2] = z[i];
      points[at + 3] = i === from ? NO_LINE : shade(i);
    }
    this.lines.add(points);
  }

  drawHits(context, from, to) {
    context.strokeStyle = colour("bad");
    context.lineWidth = 1.6;
    let last = [-99, -99];
    for (let k = lowerBound(this.hits, from); k < this.hits.length && this.hits[k] < to; k++) {
      const [x, y] = this.screen(this.hits[k]);
      if (Math.abs(x - last[0]) + Math.abs(y - last[1]) < 3) continue;
      last = [x, y];
      context.beginPath();
      context.arc(x, y, 5, 0, 2 * Math.PI);
      context.stroke();
    }
  }

  drawLegend(context, low, high) {
    const left = 12, top = 26, wide = Math.min(220, this.camera.width - 40), scale = this.source.scale();
    context.fillStyle = colour("card");
    context.globalAlpha = 0.85;
    context.fillRect(4, 4, wide + 28, 50);
    context.globalAlpha = 1;
    shades().forEach((shade, k) => {
      context.fillStyle = `rgb(${shade.join()})`;
      context.fillRect(left + k * wide / SHADES, top, wide / SHADES + 0.5, 8);
    });
    context.fillStyle = colour("soft");
    context.textAlign = "left";
    context.textBaseline = "top";
    context.fillText(`${this.source.name}${this.source.unit() ? " in " + this.source.unit() : ""}`, left, 8);
    context.textAlign = "center";
    const places = ticks(low * scale, high * scale, 4);
    tickLabels(places).forEach((label, k) => {
      context.fillText(label, left + (places[k] / scale - low) / (high - low) * wide, top + 12);
    });
  }

  listen() {
    const { over } = this;
    this.camera.listen(over, () => this.keepMoving());
    over.addEventListener("dblclick", () => this.fit(0, columns.t.length));
    over.addEventListener("pointermove", (event) => (event.buttons === 0 ? this.hover(event) : this.leave()));
    over.addEventListener("pointerleave", () => this.leave());
  }

  // One pixel wide while it moves, as wide as it is when it rests.
  keepMoving() {
    this.fitted = null;
    this.isMoving = true;
    clearTimeout(this.resting);
    this.resting = setTimeout(() => {
      this.isMoving = false;
      changed("look");
    }, 150);
    changed("look");
  }

  hover(event) {
    const box = this.over.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    const nearest = this.nearest(x, y);
    setCursor(nearest);
    const tip = document.getElementById("tip");
    tip.hidden = nearest === null;
    if (nearest === null) return;
    tip.textContent = tipText(nearest);
    tip.style.left = Math.max(4, Math.min(x + 14, this.camera.width - tip.offsetWidth - 6)) + "px";
    tip.style.top = (y + 16 + tip.offsetHeight > this.camera.height ? y - tip.offsetHeight - 10 : y + 16) + "px";
  }

  leave() {
    document.getElementById("tip").hidden = true;
    setCursor(null);
  }

  // The sample of the selected time that is nearest on the screen, if it is near at all.
  nearest(x, y) {
    const [from, to] = selectedRange();
    let best = null, least = 30 * 30;
    for (let i = from; i < to; i++) {
      const [px, py] = this.screen(i);
      const square = (px - x) ** 2 + (py - y) ** 2;
      if (square < least) { least = square; best = i; }
    }
    return best;
  }
}

function tipText(i) {
  const places = about.axes.map((axis, k) => `${axis.letter} ${minus(positionOf(k, i).toFixed(4))} ${axis.unit}`);
  const feed = `${number(columns.feed[i] * feedScale())} ${feedUnit()}`;
  return [`line ${columns.line[i]}`, `t ${columns.t[i].toFixed(4)} s`, `feed ${feed}`, ...places].join("\n");
}

// Extremes of a colour source within the selected time, from 0 where it never is negative.
function rangeOf(source) {
  source.extremes ||= new Extremes(source.values);
  const [low, high] = source.extremes.of(...selectedRange());
  return low > high ? [0, 1] : [Math.min(low, 0), high > 0 ? high : 1];
}

// Per sample whether any judged limit is exceeded.
function anyMarks() {
  const all = new Uint8Array(columns.t.length);
  const bits = about.jerk_is_judged ? 7 : 3;
  const lists = about.axes.map((_, axis) => [columns["marks" + axis], bits]);
  for (const [marks, mask] of [...lists, [columns.offpath || [], 1]]) {
    for (let i = 0; i < marks.length; i++) all[i] |= marks[i] & mask;
  }
  return all;
}
