// Height of a row, px: that of its name.
const BAND_ROW = 14;

// What binds where: a row for each, filled where it does.
class BandPlot extends Plot {
  constructor() {
    const rows = about.binding.length;
    super({
      title: "What binds", unit: () => "", curves: [], fixed: [0, rows],
      valueAxis: {
        splits: () => about.binding.map((_, row) => rows - row - 0.5), values: () => about.binding, grid: { show: false },
      },
    });
    this.place.style.flex = `1 0 ${rows * BAND_ROW + 12}px`;
    this.root.style.flexBasis = "auto";
    this.shares = element("i", "note");
    this.root.firstChild.append(this.shares);
  }

  drawGround(u) {
    const { ctx, bbox } = u, tall = bbox.height / about.binding.length;
    about.binding.forEach((_, row) => {
      const y = bbox.top + row * tall;
      ctx.strokeStyle = colour("grid");
      ctx.lineWidth = 1;
      if (row > 0) line(ctx, bbox.left, Math.round(y) + 0.5, bbox.left + bbox.width, Math.round(y) + 0.5);
      this.drawRow(u, 1 << row, y + 1.5 * uPlot.pxRatio, tall - 3 * uPlot.pxRatio);
    });
    this.tellShares();
  }

  drawRow(u, bit, y, tall) {
    const marks = columns.binding, end = columns.t.length, { left, width } = u.bbox;
    u.ctx.fillStyle = main();
    for (let px = 0, i = indexAt(state.from); px < width && i < end; px++) {
      const next = Math.max(indexAt(u.posToVal(left + px + 1, "x", true)), i);
      let binds = 0;
      for (let k = i; k < Math.max(next, i + 1) && k < end; k++) binds |= marks[k] & bit;
      if (binds) u.ctx.fillRect(left + px, y, 1, tall);
      i = next;
    }
  }

  // Shares of the time in motion that is selected.
  tellShares() {
    const [from, to] = selectedRange();
    const counts = about.binding.map(() => 0);
    let moving = 0;
    for (let i = from; i < to; i++) {
      moving += columns.feed[i] > 1e-6;
      counts.forEach((_, row) => (counts[row] += (columns.binding[i] >> row) & 1));
    }
    const words = about.binding.map((name, row) => [name, counts[row]]).filter(([, count]) => count > 0);
    this.shares.textContent = words.map(([name, count]) => `${name} ${(100 * count / moving).toFixed(0)} %`).join(" · ");
  }
}

function bandPlot() {
  return columns.binding ? [new BandPlot()] : [];
}
