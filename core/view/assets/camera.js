// A parallel view of space: turned by dragging, moved with the shift key or two fingers, scaled by the wheel at the pointer. The
// planes look along an axis.
const PLANES = { XY: [[1, 0, 0], [0, 1, 0]], XZ: [[1, 0, 0], [0, 0, 1]], YZ: [[0, 1, 0], [0, 0, 1]] };
// The middle of the view lies below that of the picture by this much, px: above it is what names the colours.
const BELOW_MIDDLE = 14;

class Camera {
  constructor() {
    this.yaw = -0.6;
    this.pitch = 0.55;
    this.centre = [0, 0, 0];
    this.scale = 1;
    this.width = this.height = 0;
    this.show("3D");
  }

  show(name) {
    this.name = name;
    this.turn();
  }

  get isPlane() {
    return Boolean(PLANES[this.name]);
  }

  // Right and up, in mm of space per mm of screen.
  turn() {
    if (this.isPlane) { [this.right, this.up] = PLANES[this.name]; return; }
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    this.right = [cy, sy, 0];
    this.up = [-sy * sp, cy * sp, cp];
  }

  // Shows a box of space.
  fit([low, high]) {
    const ends = { u0: Infinity, u1: -Infinity, v0: Infinity, v1: -Infinity };
    for (let corner = 0; corner < 8; corner++) {
      this.widen(ends, [0, 1, 2].map((axis) => (corner >> axis & 1 ? high : low)[axis]));
    }
    this.frame(ends, [0, 1, 2].map((axis) => (low[axis] + high[axis]) / 2));
  }

  widen(ends, point) {
    const u = inner(this.right, point), v = inner(this.up, point);
    if (u < ends.u0) ends.u0 = u;
    if (u > ends.u1) ends.u1 = u;
    if (v < ends.v0) ends.v0 = v;
    if (v > ends.v1) ends.v1 = v;
  }

  // Shows what lies between these ends on the screen, about a point that turning leaves where it is.
  frame({ u0, u1, v0, v1 }, about) {
    if (!(this.width > 0 && this.height > 0 && u0 <= u1)) return;
    this.scale = Math.min((this.width - 80) / Math.max(u1 - u0, 1e-3), (this.height - 104) / Math.max(v1 - v0, 1e-3));
    const du = (u0 + u1) / 2 - inner(this.right, about), dv = (v0 + v1) / 2 - inner(this.up, about);
    this.centre = [0, 1, 2].map((axis) => about[axis] + du * this.right[axis] + dv * this.up[axis]);
  }

  // A point of space on the screen, px.
  screen([x, y, z]) {
    const point = [x - this.centre[0], y - this.centre[1], z - this.centre[2]];
    return [this.width / 2 + inner(this.right, point) * this.scale, this.height / 2 + BELOW_MIDDLE - inner(this.up, point) * this.scale];
  }

  move(dx, dy) {
    this.centre = [0, 1, 2].map((axis) => this.centre[axis] + (-dx * this.right[axis] + dy * this.up[axis]) / this.scale);
  }

  rotate(dx, dy) {
    if (this.isPlane) { this.move(dx, dy); return; }
    this.yaw -= dx * 0.008;
    this.pitch = Math.min(Math.max(this.pitch + dy * 0.008, -Math.PI / 2), Math.PI / 2);
    this.turn();
  }

  // Larger or smaller about a place of the screen.
  zoom(factor, [x, y]) {
    const before = this.scale;
    this.scale = Math.min(Math.max(before * factor, 1e-3), 1e6);
    const away = this.scale / before - 1;
    this.move(-(x - this.width / 2) * away, -(y - this.height / 2 - BELOW_MIDDLE) * away);
  }

  // What a drawing of it needs, as plain numbers.
  view() {
    const { right, up, centre, scale, width, height } = this;
    return { right, up, centre, scale, width, height, below: BELOW_MIDDLE, ratio: window.devicePixelRatio || 1 };
  }

  // Follows fingers, mouse and wheel over `node`; `changed` is called whenever that has changed the view.
  listen(node, changed) {
    const fingers = new Map();
    const place = (event) => {
      const box = node.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    node.addEventListener("pointerdown", (event) => {
      node.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, place(event));
    });
    node.addEventListener("pointermove", (event) => {
      const last = fingers.get(event.pointerId);
      if (!last) return;
      const now = place(event);
      const [dx, dy] = [now[0] - last[0], now[1] - last[1]];
      if (fingers.size === 2) {
        const [other] = [...fingers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
        const apart = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]);
        this.zoom(apart(now) / Math.max(apart(last), 1), [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2]);
        this.move(dx / 2, dy / 2);
      } else if (event.shiftKey || event.buttons & 6) this.move(dx, dy);
      else this.rotate(dx, dy);
      fingers.set(event.pointerId, now);
      changed();
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) node.addEventListener(name, (event) => fingers.delete(event.pointerId));
    node.addEventListener("contextmenu", (event) => event.preventDefault());
    node.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015), place(event));
      changed();
    }, { passive: false });
  }
}

function inner(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
