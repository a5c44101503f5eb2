// One kind of plot over time, by uPlot: limits as dashed lines, a range that goes up to a limit that is near, round places on the
// axes.
const GUTTER = { left: 80, right: 14 };
// A limit is shown from this share of it on: then the distance to it is what matters.
const NEAR_A_LIMIT = 0.25;

// What is plotted: { times, curves, hasTime, label } and, where they differ from the usual, scale() of what is shown, `fixed` range,
// fromZero, `least` half-height, hooks, cursor. A curve is { label, values, colour(), limit, isTwoSided, isShown(), extent(), paths };
// one that knows its `extent` within the time that is shown need not be looked through for it.
function timePlot(place, what) {
  const scale = () => (what.scale ? what.scale() : 1);
  const perPixel = (size) => size / uPlot.pxRatio;
  const axis = { stroke: () => colour("soft"), grid: { stroke: () => colour("grid"), width: 1 }, ticks: { show: false }, font: FONT };
  const timeAxis = {
    ...axis, size: what.hasTime ? 24 : 0, splits: (u, _, low, high) => ticks(low, high, perPixel(u.bbox.width) / 90),
    values: (u, places) => (what.hasTime ? tickLabels(places).map((label) => label + " s") : places.map(() => "")),
  };
  const valueAxis = {
    ...axis, size: GUTTER.left,
    splits: (u, _, low, high) => ticks(low * scale(), high * scale(), perPixel(u.bbox.height) / 20).map((at) => at / scale()),
    values: (u, places) => tickLabels(places.map((at) => at * scale())),
    ...what.valueAxis,
  };
  const series = what.curves.map((curve) => ({
    label: curve.label, stroke: () => curve.colour(), width: curve.width || 1.5, points: { size: 4, width: 0, fill: () => curve.colour() },
    auto: !curve.extent, paths: curve.paths, show: !curve.isShown || curve.isShown(),
  }));
  const options = {
    width: Math.max(place.clientWidth, 80), height: Math.max(place.clientHeight, 30),
    padding: [6, GUTTER.right, what.hasTime ? 0 : 5, 0], legend: { show: false }, cursor: { show: false, ...what.cursor },
    scales: { x: { time: false }, y: { range: (u, low, high) => valueRange(what, low, high) } },
    axes: [timeAxis, valueAxis], series: [{}, ...series],
    hooks: { ...what.hooks, draw: [(u) => drawLimits(u, what), ...((what.hooks && what.hooks.draw) || [])] },
  };
  const plot = new uPlot(options, [what.times, ...what.curves.map((curve) => curve.values)], place);
  plot.over.setAttribute("role", "img");
  plot.over.setAttribute("aria-label", what.label);
  return plot;
}

// What is drawn, with a limit wherever the curves come near it.
function valueRange(what, low, high) {
  if (what.fixed) return what.fixed;
  const shown = what.curves.filter((curve) => !curve.isShown || curve.isShown());
  let least = what.least || 1e-9, [bottom, top] = [low ?? Infinity, high ?? -Infinity];
  for (const curve of shown.filter((one) => one.extent)) {
    const [from, to] = curve.extent();
    bottom = Math.min(bottom, from);
    top = Math.max(top, to);
  }
  if (what.fromZero) [bottom, top] = [Math.min(bottom, 0), Math.max(top, 0)];
  if (!(bottom <= top)) return [-1, 1];
  const drawn = [bottom, top];
  for (const { limit, isTwoSided } of shown) {
    if (!Number.isFinite(limit) || !limit) continue;
    least = Math.max(least, limit * 1e-4);
    if (drawn[1] > limit * NEAR_A_LIMIT) top = Math.max(top, limit);
    if (isTwoSided !== false && drawn[0] < -limit * NEAR_A_LIMIT) bottom = Math.min(bottom, -limit);
  }
  const pad = Math.max(top - bottom, least) * 0.07;
  return [what.fromZero && bottom === 0 ? 0 : bottom - pad, top + pad];
}

// The limits of what is shown; one that several have is nobody's.
function drawLimits(u, what) {
  const limits = new Map();
  const { min, max } = u.scales.y;
  for (const curve of what.curves) {
    if (!Number.isFinite(curve.limit) || (curve.isShown && !curve.isShown())) continue;
    for (const side of curve.isTwoSided === false ? [curve.limit] : [curve.limit, -curve.limit]) {
      if (side >= min && side <= max) limits.set(side, limits.has(side) ? colour("soft") : curve.colour());
    }
  }
  const { ctx, bbox } = u, { pxRatio } = uPlot, scale = what.scale ? what.scale() : 1;
  ctx.save();
  ctx.font = FONT.replace(/^\d+/, (size) => size * pxRatio);
  ctx.textAlign = "right";
  for (const [value, stroke] of limits) {
    const y = Math.round(u.valToPos(value, "y", true)) + 0.5, isMirrored = limits.has(-value);
    ctx.strokeStyle = ctx.fillStyle = stroke;
    ctx.lineWidth = 1.1 * pxRatio;
    ctx.setLineDash([6 * pxRatio, 4 * pxRatio]);
    line(ctx, bbox.left, y, bbox.left + bbox.width, y);
    ctx.setLineDash([]);
    if (isMirrored && value < 0) continue;
    const isBelow = y - bbox.top < 15 * pxRatio;
    ctx.textBaseline = isBelow ? "top" : "bottom";
    plate(ctx, `limit ${isMirrored ? "±" : ""}${number(value * scale)}`, bbox.left + bbox.width - 4 * pxRatio, y + (isBelow ? 3 : -2) * pxRatio);
  }
  ctx.restore();
}
