// Height of a row, px: that of its name.
const BAND_ROW = 12.5;

// What binds where: a row for each, filled where it does.
class BandPlot extends Plot {
  constructor() {
    super({ title: "What binds", unit: () => "", curves: [], fixed: [0, about.binding.length] });
    this.canvas.style.flex = `1 0 ${about.binding.length * BAND_ROW + 9}px`;
    this.root.style.flexBasis = "auto";
    this.shares = element("i", "note");
    this.root.firstChild.append(this.shares);
  }

  drawGrid({ context, left, top, width, bottom, x }) {
    const tall = (bottom - top) / about.binding.length;
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.lineWidth = 1;
    context.strokeStyle = theme.css.grid;
    for (const t of timeTicks(width)) line(context, Math.round(x(t)) + 0.5, top, Math.round(x(t)) + 0.5, bottom);
    about.binding.forEach((name, row) => {
      const y = top + row * tall;
      context.fillStyle = theme.css.soft;
      context.fillText(name, left - 6, y + tall / 2, left - 8);
      if (row > 0) line(context, left, Math.round(y) + 0.5, left + width, Math.round(y) + 0.5);
      this.drawRow(this.frame, 1 << row, y + 1.5, tall - 3);
    });
    this.tellShares();
  }

  drawRow({ context, left, width, x, time }, bit, y, tall) {
    const marks = columns.binding, end = columns.t.length;
    context.fillStyle = main();
    for (let px = 0, i = indexAt(state.from); px < width && i < end; px++) {
      const next = Math.max(indexAt(time(px + 1)), i);
      let binds = 0;
      for (let k = i; k < Math.max(next, i + 1) && k < end; k++) binds |= marks[k] & bit;
      if (binds) context.fillRect(left + px, y, 1, tall);
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
