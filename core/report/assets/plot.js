const GUTTER = { left: 62, right: 12 };

// One plot over the shared time: a legend that hides and reads out curves, and a canvas.
class Plot {
  // what: { title, unit(), curves, note, fromZero, fixed: [low, high], major }
  constructor(what) {
    Object.assign(this, { fromZero: false, fixed: null, note: "", major: false }, what);
    this.root = element("div", "plot" + (this.major ? " major" : ""));
    this.canvas = element("canvas");
    this.canvas.setAttribute("aria-label", this.title);
    this.root.append(this.legend(), this.canvas);
    listenToTime(this.canvas);
  }

  legend() {
    const legend = element("div", "legend");
    this.unitLabel = element("i");
    legend.append(element("strong", "", this.title), this.unitLabel);
    this.keys = this.curves.map((curve) => {
      const key = element("button", "key", curve.label);
      key.title = "hide or show";
      key.onclick = () => toggle(curve.key);
      key.append(element("span"));
      legend.append(key);
      return key;
    });
    if (this.note) {
      const note = element("i", "note", this.note);
      note.title = this.note;
      legend.append(note);
    }
    return legend;
  }

  draw() {
    const prepared = prepare(this.canvas);
    this.frame = this.makeFrame(prepared);
    this.unitLabel.textContent = this.unit();
    this.drawGrid(this.frame);
    this.drawLegend();
    const { context, left, top, width, bottom } = this.frame;
    const visible = this.curves.filter((curve) => curve.visible);
    context.save();
    context.beginPath();
    context.rect(left, top - 1, width, bottom - top + 2);
    context.clip();
    visible.forEach((curve) => curve.draw(this.frame));
    visible.forEach((curve) => curve.drawHits(this.frame));
    this.drawSelection(this.frame);
    this.drawCursor(this.frame, visible);
    context.restore();
    this.drawLimits(this.frame, visible);
  }

  makeFrame({ context, width, height }) {
    const left = GUTTER.left, top = 4, bottom = height - 5;
    const inner = Math.max(width - left - GUTTER.right, 10);
    const [low, high] = this.valueRange();
    const perSecond = inner / (state.to - state.from);
    return {
      context, left, top, bottom, width: inner, low, high,
      x: (t) => left + (t - state.from) * perSecond,
      time: (px) => state.from + px / perSecond,
      y: (value) => bottom - (value - low) / (high - low) * (bottom - top),
    };
  }

  // What is drawn, with a limit wherever the curves come near it: then the distance to it is what matters.
  valueRange() {
    if (this.fixed) return this.fixed;
    let low = this.fromZero ? 0 : Infinity, high = this.fromZero ? 0 : -Infinity, least = 1e-9;
    for (const curve of this.curves.filter((c) => c.visible)) {
      const [least_, most] = curve.range();
      low = Math.min(low, least_);
      high = Math.max(high, most);
      least = Math.max(least, curve.least);
      if (!curve.limit) continue;
      const limit = curve.limit * curve.scale();
      least = Math.max(least, limit * 1e-4);
      if (most > limit * 0.25) high = Math.max(high, limit);
      if (curve.twoSided && least_ < -limit * 0.25) low = Math.min(low, -limit);
    }
    if (!(low <= high)) return [-1, 1];
    const pad = Math.max(high - low, least) * 0.07;
    return [this.fromZero && low === 0 ? 0 : low - pad, high + pad];
  }

  drawGrid({ context, left, top, width, bottom, low, high, x, y }) {
    const places = ticks(low, high, (bottom - top) / 15);
    const labels = tickLabels(places);
    context.lineWidth = 1;
    context.fillStyle = theme.css.soft;
    context.textAlign = "right";
    context.textBaseline = "middle";
    places.forEach((place, k) => {
      const middle = Math.round(y(place)) + 0.5;
      context.strokeStyle = Math.abs(place) < 1e-12 ? theme.css.line : theme.css.grid;
      line(context, left, middle, left + width, middle);
      context.fillText(labels[k], left - 6, Math.min(Math.max(middle, top + 4), bottom - 3));
    });
    context.strokeStyle = theme.css.grid;
    for (const t of timeTicks(width)) line(context, Math.round(x(t)) + 0.5, top, Math.round(x(t)) + 0.5, bottom);
  }

  drawLimits(frame, visible) {
    const limits = new Map();
    for (const curve of visible.filter((c) => c.limit)) {
      const value = curve.limit * curve.scale();
      for (const side of curve.twoSided ? [value, -value] : [value]) {
        limits.set(side, limits.has(side) ? theme.css.soft : curve.colour());
      }
    }
    const seen = [...limits].filter(([value]) => value >= frame.low && value <= frame.high);
    for (const [value, colour] of seen) {
      const mirrored = seen.some(([other]) => other === -value);
      this.drawLimit(frame, value, colour, mirrored && value < 0 ? "" : (mirrored ? "limit ±" : "limit ") + number(value));
    }
  }

  drawLimit({ context, left, width, top, bottom, y }, value, colour, text) {
    const middle = Math.round(y(value)) + 0.5;
    context.strokeStyle = context.fillStyle = colour;
    context.lineWidth = 1.1;
    context.setLineDash([6, 4]);
    line(context, left, middle, left + width, middle);
    context.setLineDash([]);
    context.textAlign = "right";
    const below = value < 0 ? bottom - middle > 14 : middle - top < 14;
    context.textBaseline = below ? "top" : "bottom";
    plate(context, text, left + width - 4, middle + (below ? 2 : -1));
  }

  drawSelection({ context, top, bottom, x }) {
    if (!dragged) return;
    context.fillStyle = theme.css.select;
    context.fillRect(x(dragged.from), top, x(dragged.to) - x(dragged.from), bottom - top);
  }

  drawCursor(frame, visible) {
    if (state.cursor === null) return;
    const { context, top, bottom } = frame;
    const x = frame.x(columns.t[state.cursor]);
    context.strokeStyle = theme.css.soft;
    context.lineWidth = 1;
    line(context, Math.round(x) + 0.5, top, Math.round(x) + 0.5, bottom);
    for (const curve of visible) {
      context.fillStyle = curve.colour();
      dot(frame, x, frame.y(curve.values[state.cursor] * curve.scale()), 3);
    }
  }

  drawLegend() {
    this.curves.forEach((curve, k) => {
      const key = this.keys[k];
      key.style.setProperty("--key", curve.colour());
      key.setAttribute("aria-pressed", curve.visible);
      key.lastChild.textContent = state.cursor === null ? "" : number(curve.values[state.cursor] * curve.scale());
    });
  }
}

function element(tag, className = "", text = "") {
  const made = document.createElement(tag);
  made.className = className;
  made.textContent = text;
  return made;
}

function line(context, x0, y0, x1, y1) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

// Text that stays legible over curves.
function plate(context, text, x, y) {
  context.save();
  context.lineJoin = "round";
  context.lineWidth = 4;
  context.strokeStyle = theme.css.card;
  context.globalAlpha = 0.85;
  context.strokeText(text, x, y);
  context.restore();
  context.fillText(text, x, y);
}

function timeTicks(width) {
  return ticks(state.from, state.to, width / 90);
}
