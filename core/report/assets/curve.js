// One curve of a plot: a column, how it is shown, and where it is too large. What of it is drawn is made here, since a run has
// millions of samples: of each column of pixels the extremes, which are summed up once.
class Curve {
  // look: { key, label, colour(), limit, isTwoSided, bit, judged, range(): the samples that are shown }
  constructor(values, marks, look) {
    Object.assign(this, { limit: null, isTwoSided: true, judged: true, range: selectedRange }, look);
    this.values = values;
    this.extremes = new Extremes(values);
    this.hits = marks ? hitsOf(marks, this.bit) : [];
    this.paths = (u) => this.path(u);
  }

  isShown() {
    return !state.hidden.has(this.key);
  }

  // [low, high] within the selected time and one sample around it.
  extent() {
    return this.extremes.of(...this.range());
  }

  path(u) {
    const path = new Path2D(), [from, to] = this.range();
    if (to - from > 2 * u.bbox.width / uPlot.pxRatio) this.traceExtremes(u, path); else this.traceSamples(u, path, from, to);
    return { stroke: path };
  }

  traceSamples(u, path, from, to) {
    let isBroken = true;
    for (let i = from; i < to; i++) {
      const value = this.values[i];
      if (isNaN(value)) { isBroken = true; continue; }
      const x = u.valToPos(columns.t[i], "x", true), y = u.valToPos(value, "y", true);
      if (isBroken) path.moveTo(x, y); else path.lineTo(x, y);
      isBroken = false;
    }
  }

  // From each column of pixels its smallest and largest value: no peak gets lost between pixels.
  traceExtremes(u, path) {
    let previous = null;
    for (let px = 0, i = indexAt(u.scales.x.min); px < u.bbox.width; px++) {
      const end = indexAt(u.posToVal(u.bbox.left + px + 1, "x", true));
      const [low, high] = this.extremes.of(i, end), isSampled = end > i;
      i = end;
      if (low > high) {
        // Samples without a value are a gap; a column without samples is none.
        if (isSampled) previous = null;
        continue;
      }
      const x = u.bbox.left + px + 0.5;
      const ends = [u.valToPos(low, "y", true), u.valToPos(high, "y", true)];
      if (previous !== null && Math.abs(previous - ends[1]) < Math.abs(previous - ends[0])) ends.reverse();
      if (previous === null) path.moveTo(x, ends[0]); else path.lineTo(x, ends[0]);
      path.lineTo(x, ends[1]);
      previous = ends[1];
    }
  }

  // What is too much: a band over the whole height, so that one sample in a million is seen, and the value itself.
  drawHits(u) {
    if (this.hits.length === 0) return;
    const { ctx } = u, { pxRatio } = uPlot;
    ctx.fillStyle = ctx.strokeStyle = colour(this.judged ? "bad" : "warn");
    let drawn = -Infinity;
    for (let k = lowerBound(this.hits, indexAt(state.from)); k < this.hits.length; k++) {
      const i = this.hits[k], x = u.valToPos(columns.t[i], "x", true);
      if (columns.t[i] > state.to) break;
      if (x - drawn < pxRatio) continue;
      if (this.judged) drawBand(u, x, drawn);
      dot(ctx, x, u.valToPos(this.values[i], "y", true), 2.4 * pxRatio);
      drawn = x;
    }
  }
}

function drawBand({ ctx, bbox }, x, drawn) {
  const { top, height } = bbox, { pxRatio } = uPlot, half = 1.5 * pxRatio;
  ctx.globalAlpha = 0.2;
  ctx.fillRect(Math.max(x - half, drawn + half), top, Math.min(2 * half, x - drawn), height);
  ctx.globalAlpha = 1;
  ctx.beginPath();
  ctx.moveTo(x - 3.5 * pxRatio, top);
  ctx.lineTo(x + 3.5 * pxRatio, top);
  ctx.lineTo(x, top + 5 * pxRatio);
  ctx.fill();
}

function dot(context, x, y, radius) {
  if (isNaN(y)) return;
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
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
