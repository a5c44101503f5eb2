// What stands around the path: grid, legend, triad, scale bar. Adds to PathView.
Object.assign(PathView.prototype, {
  // Lines at round positions, labelled at the left and at the bottom in machine coordinates.
  drawGrid() {
    const { context, width, height } = this;
    const [across, upward] = [this.right, this.up].map((direction) => direction.indexOf(1));
    context.fillStyle = theme.css.faint;
    context.strokeStyle = theme.css.grid;
    context.lineWidth = 1;
    const middle = (axis, centre) => centre + this.offsetOf(axis);
    const u = middle(across, this.centre[0]), v = middle(upward, this.centre[1]);
    const us = ticks(u - width / 2 / this.scale, u + width / 2 / this.scale, width / 80);
    const vs = ticks(v - height / 2 / this.scale, v + height / 2 / this.scale, height / 60);
    context.textAlign = "center";
    context.textBaseline = "bottom";
    tickLabels(us).forEach((label, k) => {
      const x = Math.round(width / 2 + (us[k] - u) * this.scale) + 0.5;
      line(context, x, 0, x, height - 18);
      if (x > 70 && x < width - 110) context.fillText(label, x, height - 4);
    });
    context.textAlign = "left";
    context.textBaseline = "middle";
    tickLabels(vs).forEach((label, k) => {
      const y = Math.round(height / 2 - (vs[k] - v) * this.scale + 12) + 0.5;
      line(context, 0, y, width, y);
      if (y > 52 && y < height - 24) plate(context, label, 5, y);
    });
    this.nameAxes(across, upward);
  },

  nameAxes(across, upward) {
    const { context, height } = this;
    context.textAlign = "left";
    context.textBaseline = "bottom";
    context.font = "600 12px system-ui, 'Liberation Sans', Arial, sans-serif";
    const name = (place) => (this.space[place] < 0 ? "XYZ"[place] : about.axes[this.space[place]].letter);
    context.fillStyle = axisColour(name(across));
    plate(context, name(across) + " →", 32, height - 4);
    context.fillStyle = axisColour(name(upward));
    plate(context, name(upward) + " ↑", 4, height - 4);
    context.font = "11px system-ui, 'Liberation Sans', Arial, sans-serif";
  },

  offsetOf(place) {
    return this.space[place] < 0 ? 0 : about.axes[this.space[place]].centre;
  },

  drawLegend(low, high) {
    const { context } = this;
    const left = 12, top = 24, wide = Math.min(220, this.width - 40), scale = this.source.scale();
    context.fillStyle = theme.css.card;
    context.globalAlpha = 0.85;
    context.fillRect(4, 4, wide + 28, 46);
    context.globalAlpha = 1;
    theme.shades.forEach((shade, k) => {
      context.fillStyle = shade;
      context.fillRect(left + k * wide / SHADES, top, wide / SHADES + 0.5, 8);
    });
    context.fillStyle = theme.css.soft;
    context.textAlign = "left";
    context.textBaseline = "top";
    context.fillText(`${this.source.name}${this.source.unit() ? " in " + this.source.unit() : ""}`, left, 8);
    context.textAlign = "center";
    const places = ticks(low * scale, high * scale, 4);
    tickLabels(places).forEach((label, k) => {
      context.fillText(label, left + (places[k] / scale - low) / (high - low) * wide, top + 11);
    });
  },

  // Where the axes point: the longer an arm, the more it lies in the plane of the screen.
  drawTriad() {
    const { context, height } = this;
    const origin = [48, height - 44], arm = 30;
    context.lineWidth = 2;
    context.textAlign = context.textBaseline = "center";
    context.textBaseline = "middle";
    this.space.forEach((axis, place) => {
      const name = axis < 0 ? "XYZ"[place] : about.axes[axis].letter;
      const x = this.right[place] * arm, y = -this.up[place] * arm;
      context.strokeStyle = context.fillStyle = axisColour(name);
      line(context, origin[0], origin[1], origin[0] + x, origin[1] + y);
      context.fillText(name, origin[0] + x * 1.32, origin[1] + y * 1.32);
    });
  },

  drawScaleBar() {
    const { context, width, height } = this;
    const length = roundBelow(110 / this.scale);
    const right = width - 14, left = right - length * this.scale, y = height - 12;
    context.strokeStyle = context.fillStyle = theme.css.soft;
    context.lineWidth = 1.5;
    line(context, left, y, right, y);
    line(context, left, y - 4, left, y + 4);
    line(context, right, y - 4, right, y + 4);
    context.textAlign = "right";
    context.textBaseline = "bottom";
    plate(context, lengthText(length), right, y - 5);
  },
});

// The largest of 1, 2, 5, 10, 20, … that is not above `value`.
function roundBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].find((m) => m * power <= value) * power;
}

function lengthText(mm) {
  if (mm >= 1000) return number(mm / 1000) + " m";
  return mm >= 0.1 ? number(mm) + " mm" : number(mm * 1000) + " µm";
}
