// A parallel view of space: turned by dragging, moved with the shift key or two fingers, scaled by the wheel. The planes look along
// an axis.
const PLANES = { XY: [[1, 0, 0], [0, 1, 0]], XZ: [[1, 0, 0], [0, 0, 1]], YZ: [[0, 1, 0], [0, 0, 1]] };

export class Camera {
  constructor() {
    this.yaw = -0.6;
    this.pitch = 0.55;
    this.centre = [0, 0, 0];
    this.scale = 1;
    this.show("3D");
  }

  show(name) {
    this.name = name;
    this.turn();
  }

  // Right and up, in mm of space per mm of screen.
  turn() {
    if (PLANES[this.name]) { [this.right, this.up] = PLANES[this.name]; return; }
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    this.right = [cy, sy, 0];
    this.up = [-sy * sp, cy * sp, cp];
  }

  // Shows a box of space in a picture of so many pixels.
  fit([low, high], width, height) {
    if (!(width > 0 && height > 0)) return;
    let u0 = Infinity, u1 = -Infinity, v0 = Infinity, v1 = -Infinity;
    for (let corner = 0; corner < 8; corner++) {
      const point = [0, 1, 2].map((axis) => (corner >> axis & 1 ? high : low)[axis]);
      const u = dot(this.right, point), v = dot(this.up, point);
      u0 = Math.min(u0, u); u1 = Math.max(u1, u); v0 = Math.min(v0, v); v1 = Math.max(v1, v);
    }
    this.scale = Math.min((width - 60) / Math.max(u1 - u0, 1), (height - 96) / Math.max(v1 - v0, 1));
    this.centre = [0, 1, 2].map((axis) => (low[axis] + high[axis]) / 2);
  }

  // A point of space on the screen, pixels.
  screen([x, y, z], width, height) {
    const point = [x - this.centre[0], y - this.centre[1], z - this.centre[2]];
    return [width / 2 + dot(this.right, point) * this.scale, height / 2 + 14 - dot(this.up, point) * this.scale];
  }

  move(dx, dy) {
    for (const axis of [0, 1, 2]) this.centre[axis] += (-dx * this.right[axis] + dy * this.up[axis]) / this.scale;
  }

  rotate(dx, dy) {
    if (PLANES[this.name]) { this.move(dx, dy); return; }
    this.yaw -= dx * 0.008;
    this.pitch = Math.min(Math.max(this.pitch + dy * 0.008, 0), Math.PI / 2);
    this.turn();
  }

  zoom(factor) {
    this.scale = Math.min(Math.max(this.scale * factor, 1e-3), 1e5);
  }

  listen(canvas, changed) {
    const fingers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = fingers.get(event.pointerId);
      if (!last) return;
      const now = [event.clientX, event.clientY];
      const [dx, dy] = [now[0] - last[0], now[1] - last[1]];
      if (fingers.size === 2) {
        const [other] = [...fingers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
        const apart = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]);
        this.zoom(apart(now) / Math.max(apart(last), 1));
        this.move(dx / 2, dy / 2);
      } else if (event.shiftKey || event.buttons === 4) this.move(dx, dy);
      else this.rotate(dx, dy);
      fingers.set(event.pointerId, now);
      changed();
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015));
      changed();
    }, { passive: false });
  }
}

export function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
