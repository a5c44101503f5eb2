// One curve of a plot: a column, how it is shown, and where it is too large.
class Curve {
  // look: { key, label, colour(), scale(), limit, twoSided, bit, judged, least: changes that are only rounding }
  constructor(values, marks, look) {
    Object.assign(this, { scale: () => 1, limit: null, least: 1e-9, twoSided: true, judged: true }, look);
    this.values = values;
    this.extremes = new Extremes(values);
    this.hits = marks ? hitsOf(marks, this.bit) : [];
  }

  get visible() {
    return !state.hidden.has(this.key);
  }

  // [low, high] as shown, within the selected time and one sample around it.
  range() {
    const [from, to] = selectedRange();
    return this.extremes.of(from, to).map((v) => v * this.scale());
  }

  // Draws into a frame { context, x(t), y(value), width, left }.
  draw(frame) {
    const { context } = frame;
    context.strokeStyle = context.fillStyle = this.colour();
    context.lineWidth = 1.4;
    context.lineJoin = "round";
    context.beginPath();
    const [from, to] = selectedRange();
    if (to - from > frame.width * 2) this.traceExtremes(frame); else this.traceSamples(frame, from, to);
    context.stroke();
    if (to - from < frame.width / 7) this.drawDots(frame, from, to);
  }

  traceSamples(frame, from, to) {
    let broken = true;
    for (let i = from; i < to; i++) {
      const value = this.values[i] * this.scale();
      if (isNaN(value)) { broken = true; continue; }
      const x = frame.x(columns.t[i]), y = frame.y(value);
      if (broken) frame.context.moveTo(x, y); else frame.context.lineTo(x, y);
      broken = false;
    }
  }

  // From each column of pixels its smallest and largest value: no peak gets lost between pixels.
  traceExtremes(frame) {
    const scale = this.scale();
    let previous = null;
    for (let px = 0, i = indexAt(state.from); px < frame.width; px++) {
      const end = indexAt(frame.time(px + 1));
      const [low, high] = this.extremes.of(i, end), sampled = end > i;
      i = end;
      if (low > high) {
        // Samples without a value are a gap; a column without samples is none.
        if (sampled) previous = null;
        continue;
      }
      const x = frame.left + px + 0.5;
      let ends = [frame.y(low * scale), frame.y(high * scale)];
      if (previous !== null && Math.abs(previous - ends[1]) < Math.abs(previous - ends[0])) ends.reverse();
      if (previous === null) frame.context.moveTo(x, ends[0]); else frame.context.lineTo(x, ends[0]);
      frame.context.lineTo(x, ends[1]);
      previous = ends[1];
    }
  }

  drawDots(frame, from, to) {
    for (let i = from; i < to; i++) dot(frame, frame.x(columns.t[i]), frame.y(this.values[i] * this.scale()), 1.8);
  }

  // What is too much: a band over the whole height, so that one sample in a million is seen, and the value itself.
  drawHits(frame) {
    if (this.hits.length === 0) return;
    const { context } = frame;
    context.fillStyle = context.strokeStyle = this.judged ? theme.css.bad : theme.css.warn;
    let drawn = -Infinity;
    for (let k = lowerBound(this.hits, indexAt(state.from)); k < this.hits.length; k++) {
      const i = this.hits[k], x = frame.x(columns.t[i]);
      if (columns.t[i] > state.to) break;
      if (x - drawn < 1) continue;
      if (this.judged) drawBand(frame, x, drawn);
      dot(frame, x, frame.y(this.values[i] * this.scale()), 2.4);
      drawn = x;
    }
  }
}

function drawBand(frame, x, drawn) {
  const { context, top, bottom } = frame;
  context.globalAlpha = 0.2;
  context.fillRect(Math.max(x - 1.5, drawn + 1.5), top, Math.min(3, x - drawn), bottom - top);
  context.globalAlpha = 1;
  context.beginPath();
  context.moveTo(x - 3.5, top);
  context.lineTo(x + 3.5, top);
  context.lineTo(x, top + 5);
  context.fill();
}

function dot(frame, x, y, radius) {
  if (isNaN(y)) return;
  frame.context.beginPath();
  frame.context.arc(x, y, radius, 0, 2 * Math.PI);
  frame.context.fill();
}

function hitsOf(marks, bit) {
  const hits = [];
  for (let i = 0; i < marks.length; i++) if (marks[i] & bit) hits.push(i);
  return hits;
}

function lowerBound(sorted, value) {
  let low = 0, high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] < value) low = middle + 1; else high = middle;
  }
  return low;
}

function selectedRange() {
  return [Math.max(indexAt(state.from) - 1, 0), Math.min(indexAt(state.to) + 1, columns.t.length)];
}
