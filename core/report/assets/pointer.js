// How the pointer moves the path and finds a sample on it. Adds to PathView.
Object.assign(PathView.prototype, {
  listen() {
    const { canvas } = this;
    canvas.addEventListener("wheel", (event) => this.zoom(event), { passive: false });
    canvas.addEventListener("dblclick", () => this.fit(0, columns.t.length));
    canvas.addEventListener("pointerdown", (event) => this.grab(event));
    canvas.addEventListener("pointermove", (event) => event.buttons === 0 && this.hover(event));
    canvas.addEventListener("pointerleave", () => this.leave());
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  },

  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  },

  zoom(event) {
    event.preventDefault();
    const [x, y] = this.place(event), factor = Math.exp(-event.deltaY * 0.0015);
    const u = (x - this.width / 2) / this.scale, v = -(y - 12 - this.height / 2) / this.scale;
    this.centre[0] += u * (1 - 1 / factor);
    this.centre[1] += v * (1 - 1 / factor);
    this.scale *= factor;
    this.keepMoving();
  },

  grab(event) {
    let [x, y] = this.place(event);
    const turning = this.name === "3D" && event.button === 0 && !event.shiftKey;
    this.leave();
    drag(event, this.canvas, (move) => {
      const [toX, toY] = this.place(move);
      if (turning) this.rotate(toX - x, toY - y); else this.pan(toX - x, toY - y);
      [x, y] = [toX, toY];
      this.keepMoving();
    });
  },

  pan(dx, dy) {
    this.centre[0] -= dx / this.scale;
    this.centre[1] += dy / this.scale;
  },

  // Turns about the middle of the picture's path, which the coordinates have as their origin.
  rotate(dx, dy) {
    this.yaw -= dx * 0.008;
    this.pitch = Math.min(Math.max(this.pitch + dy * 0.008, -Math.PI / 2), Math.PI / 2);
    this.turn();
  },

  // A draft while it moves, the full picture when it rests.
  keepMoving() {
    this.moving = true;
    clearTimeout(this.resting);
    this.resting = setTimeout(() => {
      this.moving = false;
      changed("look");
    }, 150);
    changed("look");
  },

  hover(event) {
    const [x, y] = this.place(event);
    const nearest = this.nearest(x, y);
    setCursor(nearest);
    const tip = document.getElementById("tip");
    tip.hidden = nearest === null;
    if (nearest === null) return;
    tip.textContent = tipText(nearest);
    tip.style.left = Math.max(4, Math.min(x + 14, this.width - tip.offsetWidth - 6)) + "px";
    tip.style.top = (y + 16 + tip.offsetHeight > this.height ? y - tip.offsetHeight - 10 : y + 16) + "px";
  },

  leave() {
    document.getElementById("tip").hidden = true;
    setCursor(null);
  },

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
  },
});

function tipText(i) {
  const places = about.axes.map((axis, k) => `${axis.letter} ${minus(positionOf(k, i).toFixed(4))} ${axis.unit}`);
  const feed = `${number(columns.feed[i] * feedScale())} ${feedUnit()}`;
  return [`line ${columns.line[i]}`, `t ${columns.t[i].toFixed(4)} s`, `feed ${feed}`, ...places].join("\n");
}
