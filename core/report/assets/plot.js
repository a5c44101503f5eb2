// One plot over the time that all share: a legend that hides and reads out curves above a plot of the kind that the operator's page
// has too.
class Plot {
  // what: { title, unit(), scale(), curves, note, fromZero, fixed: [low, high], least, major, valueAxis }
  constructor(what) {
    Object.assign(this, { scale: () => 1, note: "", major: false }, what);
    this.root = element("div", "plot" + (this.major ? " major" : ""));
    this.place = element("div", "place");
    this.root.append(this.legend(), this.place);
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

  // Once it has its place on the page.
  begin() {
    const isMine = () => null;
    this.u = timePlot(this.place, {
      ...this, label: this.title, times: columns.t,
      // The pointer moves one cursor for all plots and the path: state.js has it.
      cursor: { show: true, y: false, drag: { x: false, y: false }, bind: { mousedown: isMine, mouseup: isMine, mousemove: isMine, mouseleave: isMine, mouseenter: isMine, click: isMine, dblclick: isMine } },
      hooks: { drawAxes: [(u) => this.drawGround(u)], draw: [(u) => this.drawAbove(u)] },
    });
    listenToTime(this.u.over);
    new ResizeObserver(() => this.u.setSize({ width: this.place.clientWidth, height: this.place.clientHeight })).observe(this.place);
  }

  drawGround() {}

  drawAbove(u) {
    const { left, top, width, height } = u.bbox;
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(left, top, width, height);
    u.ctx.clip();
    for (const curve of this.curves) if (curve.isShown()) curve.drawHits(u);
    u.ctx.restore();
    if (!dragged) return;
    const [from, to] = [dragged.from, dragged.to].map((t) => u.valToPos(t, "x", true));
    u.ctx.fillStyle = colour("select");
    u.ctx.fillRect(from, top, to - from, height);
  }

  draw(kinds) {
    this.unitLabel.textContent = this.unit();
    const { u } = this;
    if (kinds.has("window") || kinds.has("look")) {
      u.batch(() => {
        this.curves.forEach((curve, index) => {
          if (u.series[index + 1].show !== curve.isShown()) u.setSeries(index + 1, { show: curve.isShown() });
        });
        u.setScale("x", { min: state.from, max: state.to });
      });
      u.redraw(true, true);
    }
    const isSeen = state.cursor !== null;
    u.setCursor(isSeen ? { left: u.valToPos(columns.t[state.cursor], "x"), top: 1 } : { left: -10, top: -10 }, false);
    this.curves.forEach((curve, k) => {
      const key = this.keys[k];
      key.style.setProperty("--key", curve.colour());
      key.setAttribute("aria-pressed", curve.isShown());
      key.lastChild.textContent = isSeen ? number(curve.values[state.cursor] * this.scale()) : "";
    });
  }
}

function element(tag, className = "", text = "") {
  const made = document.createElement(tag);
  made.className = className;
  made.textContent = text;
  return made;
}
