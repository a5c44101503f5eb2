// The views: which directions of space point right and up on the screen.
const PLANES = { XY: [[1, 0, 0], [0, 1, 0]], XZ: [[1, 0, 0], [0, 0, 1]], YZ: [[0, 1, 0], [0, 0, 1]] };

// Points drawn while the picture moves; when it rests, all that differ on the screen are.
const DRAFT_POINTS = 40000;

// The axes that span the path: X, Y and Z where the machine has them, else its first ones.
function spaceAxes() {
  const named = ["X", "Y", "Z"].map((letter) => about.axes.findIndex((axis) => axis.letter === letter && axis.linear));
  return named.some((i) => i >= 0) ? named : [0, 1, 2].map((i) => (i < about.axes.length ? i : -1));
}

class PathView {
  constructor(canvas) {
    this.canvas = canvas;
    this.space = spaceAxes();
    this.points = this.space.map((axis) => (axis < 0 ? new Float32Array(columns.t.length) : columns["position" + axis]));
    this.yaw = -0.6;
    this.pitch = 0.55;
    this.centre = [0, 0, 0];
    this.scale = 1;
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
    this.name = name;
    this.turn();
    this.fit(0, columns.t.length);
  }

  // Right and up, in mm of space per mm of screen.
  turn() {
    if (PLANES[this.name]) { [this.right, this.up] = PLANES[this.name]; return; }
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    this.right = [cy, sy, 0];
    this.up = [-sy * sp, cy * sp, cp];
  }

  fit(from, to) {
    const step = Math.max(1, Math.floor((to - from) / 100000));
    let u0 = Infinity, u1 = -Infinity, v0 = Infinity, v1 = -Infinity;
    for (let i = from; i < to; i += step) {
      const u = this.along(this.right, i), v = this.along(this.up, i);
      u0 = Math.min(u0, u); u1 = Math.max(u1, u);
      v0 = Math.min(v0, v); v1 = Math.max(v1, v);
    }
    if (!(u0 <= u1)) return;
    const wide = this.canvas.clientWidth - 96, high = this.canvas.clientHeight - 110;
    this.scale = Math.min(wide / Math.max(u1 - u0, 1e-3), high / Math.max(v1 - v0, 1e-3));
    this.centre = [(u0 + u1) / 2, (v0 + v1) / 2];
    changed("look");
  }

  along(direction, i) {
    const [x, y, z] = this.points;
    return direction[0] * x[i] + direction[1] * y[i] + direction[2] * z[i];
  }

  screen(i) {
    return [
      this.width / 2 + (this.along(this.right, i) - this.centre[0]) * this.scale,
      this.height / 2 - (this.along(this.up, i) - this.centre[1]) * this.scale + 12,
    ];
  }

  draw() {
    const { context, width, height } = prepare(this.canvas);
    Object.assign(this, { context, width, height });
    const [from, to] = selectedRange();
    const [low, high] = rangeOf(this.source);
    if (PLANES[this.name]) this.drawGrid();
    if (!allTimeSelected()) this.drawRest(from, to);
    this.drawPath(from, to, low, high);
    this.drawHits(from, to);
    this.drawCursor();
    this.drawLegend(low, high);
    if (!PLANES[this.name]) this.drawTriad();
    this.drawScaleBar();
  }

  // Calls stroke(x0, y0, x1, y1, value) for what differs by a pixel; the lowest value on the way counts.
  walk(from, to, stroke) {
    const [x, y, z] = this.points, [r, u] = [this.right, this.up], k = this.scale;
    const originX = this.width / 2 - this.centre[0] * k, originY = this.height / 2 + this.centre[1] * k + 12;
    const step = this.moving ? Math.max(1, Math.floor((to - from) / DRAFT_POINTS)) : 1;
    const least = this.moving ? 2 : 0.6;
    let px, py, value = Infinity;
    for (let i = from; i < to; i += step) {
      const sx = originX + (r[0] * x[i] + r[1] * y[i] + r[2] * z[i]) * k;
      const sy = originY - (u[0] * x[i] + u[1] * y[i] + u[2] * z[i]) * k;
      if (i === from) { px = sx; py = sy; }
      if (this.source.values[i] < value) value = this.source.values[i];
      if (Math.abs(sx - px) + Math.abs(sy - py) < least && i + step < to) continue;
      if (this.isSeen(px, py, sx, sy)) stroke(px, py, sx, sy, value);
      px = sx; py = sy; value = Infinity;
    }
  }

  isSeen(x0, y0, x1, y1) {
    return Math.max(x0, x1) > 0 && Math.min(x0, x1) < this.width && Math.max(y0, y1) > 0 && Math.min(y0, y1) < this.height;
  }

  // One stroke for each shade: a canvas is slow in changing colours, not in drawing lines.
  drawPath(from, to, low, high) {
    const shades = Array.from({ length: SHADES }, () => []);
    this.walk(from, to, (x0, y0, x1, y1, value) => shades[shadeOf(value, low, high)].push(x0, y0, x1, y1));
    this.context.lineWidth = 1.8;
    this.context.lineCap = "round";
    for (let shade = SHADES - 1; shade >= 0; shade--) this.strokeAll(shades[shade], theme.shades[shade]);
    this.context.lineCap = "butt";
  }

  strokeAll(lines, colour) {
    const { context } = this;
    context.strokeStyle = colour;
    // A sharp join of lines that nearly turn back would stand out by several line widths.
    context.lineJoin = "round";
    context.beginPath();
    let endX, endY;
    for (let k = 0; k < lines.length; k += 4) {
      if (lines[k] !== endX || lines[k + 1] !== endY) context.moveTo(lines[k], lines[k + 1]);
      context.lineTo(endX = lines[k + 2], endY = lines[k + 3]);
    }
    context.stroke();
  }

  // What lies outside of the selected time.
  drawRest(from, to) {
    const lines = [];
    const add = (x0, y0, x1, y1) => lines.push(x0, y0, x1, y1);
    this.walk(0, from + 1, add);
    this.walk(to - 1, columns.t.length, add);
    this.context.lineWidth = 1;
    this.context.globalAlpha = 0.55;
    this.strokeAll(lines, theme.css.faint);
    this.context.globalAlpha = 1;
  }

  drawHits(from, to) {
    const { context } = this;
    context.strokeStyle = theme.css.bad;
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

  drawCursor() {
    if (state.cursor === null) return;
    const [x, y] = this.screen(state.cursor), { context } = this;
    context.lineWidth = 2;
    context.strokeStyle = theme.css.card;
    context.fillStyle = theme.css.ink;
    context.beginPath();
    context.arc(x, y, 5, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
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
