// Straight lines through points of space, any number of them, in as many colours as SHADES. What comes to a picture that stands is
// drawn above it, so that each line is drawn once. By WebGL 2, where a point costs 16 bytes; where a browser has none, or has the
// processor stand in for a graphics unit, pixel by pixel: the stand-in takes ten times as long, and the browser shows nothing else
// meanwhile. Runs on a page and in a worker.
const MAX_COLOURS = 64;
// A point to which no line leads.
const NO_LINE = -1;
// Of more lines each is one pixel wide where the processor draws them.
const MAX_WIDE = 60000;
// What is shorter waits for the next line, px.
const LEAST_STROKE = 0.6;
// What browsers call a processor that stands in for a graphics unit.
const STAND_INS = /swiftshader|llvmpipe|softpipe|software|basic render/i;
const POINT_NUMBERS = 4;

const VERTEX = `#version 300 es
in vec4 from; in vec4 to; in float corner;
uniform vec3 right, up, centre; uniform vec2 size, shift; uniform float scale, width; uniform vec4 colours[${MAX_COLOURS}];
flat out vec4 colour;
vec2 place(vec3 p) { p -= centre; return vec2(dot(right, p), dot(up, p)) * scale + shift; }
void main() {
  vec2 a = place(from.xyz), b = place(to.xyz), along = b - a;
  float length = max(length(along), 1e-6);
  vec2 aside = vec2(-along.y, along.x) / length * width * 0.5;
  float end = corner < 2.0 ? 0.0 : 1.0, side = mod(corner, 2.0) * 2.0 - 1.0;
  vec2 p = mix(a, b, end) + aside * side + along / length * width * 0.25 * (end * 2.0 - 1.0);
  gl_Position = to.w < 0.0 ? vec4(2.0, 2.0, 2.0, 1.0) : vec4(p / size * 2.0, 0.0, 1.0);
  colour = colours[int(max(to.w, 0.0))];
}`;
const FRAGMENT = `#version 300 es
precision mediump float; flat in vec4 colour; out vec4 shown; void main() { shown = vec4(colour.rgb * colour.a, colour.a); }`;

class Lines {
  constructor(canvas) {
    Object.assign(this, { canvas, count: 0, values: new Float32Array(0), drawn: 0, key: "" });
    const gl = hasGraphicsUnit() ? canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true }) : null;
    this.painter = gl ? new Graphics(gl) : new Scan(canvas.getContext("2d"));
    // A computer that has slept may have lost what its graphics unit held.
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      this.painter = new Graphics(gl);
      this.drawn = 0;
      this.key = "";
    });
  }

  clear() {
    this.count = this.drawn = 0;
    this.key = "";
    this.painter.forget();
  }

  // Points of four numbers: x, y, z and the colour of the line that leads there, or NO_LINE.
  add(points) {
    const end = (this.count * POINT_NUMBERS) + points.length;
    if (end > this.values.length) {
      const more = new Float32Array(Math.max(1 << 14, this.values.length * 2, end));
      more.set(this.values.subarray(0, this.count * POINT_NUMBERS));
      this.values = more;
    }
    this.values.set(points, this.count * POINT_NUMBERS);
    this.count = end / POINT_NUMBERS;
  }

  // Keeps every second point, so that there is room for as many again.
  halve() {
    const kept = Math.floor(this.count / 2);
    for (let at = 0; at < kept; at++) this.values.copyWithin(at * POINT_NUMBERS, at * 2 * POINT_NUMBERS, (at * 2 + 1) * POINT_NUMBERS);
    this.clear();
    this.count = kept;
  }

  // Draws what is not in the picture yet; all of it where the view or a colour is another one. `thin` spares the processor what it
  // can. Answers how many points it has painted.
  draw(view, colours, width, thin = false) {
    const { canvas } = this;
    const wide = Math.max(Math.round(view.width * view.ratio), 1), high = Math.max(Math.round(view.height * view.ratio), 1);
    const isThin = !this.painter.gl && (thin || this.count > MAX_WIDE);
    const key = [view.right, view.up, view.centre, view.scale, wide, high, colours, width, isThin].join();
    const isSame = key === this.key;
    if (isSame && this.drawn === this.count) return 0;
    if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    const first = isSame ? Math.max(this.drawn - 1, 0) : 0;
    this.painter.paint(this, first, !isSame, view, colours, isThin ? 0 : width);
    this.drawn = this.count;
    this.key = key;
    return this.count - first;
  }

  // Waits until what was asked for is in the picture.
  finish() {
    if (this.painter.gl) this.painter.gl.finish();
  }
}

// Whether something else than the processor would draw: a canvas that was asked once for one kind of drawing has no other.
function hasGraphicsUnit() {
  if (typeof OffscreenCanvas === "undefined") return true;
  const gl = new OffscreenCanvas(1, 1).getContext("webgl2", { failIfMajorPerformanceCaveat: true });
  if (!gl) return false;
  const about = gl.getExtension("WEBGL_debug_renderer_info");
  const name = gl.getParameter(about ? about.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  const end = gl.getExtension("WEBGL_lose_context");
  if (end) end.loseContext();
  return !STAND_INS.test(name);
}

class Graphics {
  constructor(gl) {
    this.gl = gl;
    this.lines = this.program(VERTEX);
    this.corners = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([0, 1, 2, 3]), gl.STATIC_DRAW);
    this.buffer = gl.createBuffer();
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.forget();
  }

  forget() {
    this.room = this.sent = 0;
  }

  program(vertex) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ["to", "from", "corner"].forEach((name, place) => gl.bindAttribLocation(program, place, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) || "the shader is refused");
    return program;
  }

  // What the graphics unit does not have yet.
  send({ values, count }) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    if (this.room < values.length) {
      this.room = values.length;
      this.sent = 0;
      gl.bufferData(gl.ARRAY_BUFFER, values.byteLength, gl.DYNAMIC_DRAW);
    }
    const from = this.sent * POINT_NUMBERS;
    if (this.sent < count) gl.bufferSubData(gl.ARRAY_BUFFER, from * 4, values, from, count * POINT_NUMBERS - from);
    this.sent = count;
  }

  paint(lines, first, isAnew, view, colours, width) {
    const { gl } = this;
    gl.viewport(0, 0, lines.canvas.width, lines.canvas.height);
    if (isAnew) {
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT);
    }
    this.send(lines);
    const count = lines.count - first;
    if (count < 2) return;
    gl.useProgram(this.lines);
    const at = (name) => gl.getUniformLocation(this.lines, name);
    gl.uniform3fv(at("right"), view.right);
    gl.uniform3fv(at("up"), view.up);
    gl.uniform3fv(at("centre"), view.centre);
    gl.uniform2f(at("size"), view.width, view.height);
    gl.uniform2f(at("shift"), 0, -view.below);
    gl.uniform1f(at("scale"), view.scale);
    gl.uniform4fv(at("colours"), colours.flat());
    const bytes = POINT_NUMBERS * 4, points = (place, offset, divisor) => {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 4, gl.FLOAT, false, bytes, (first + offset) * bytes);
      gl.vertexAttribDivisor(place, divisor);
    };
    gl.uniform1f(at("width"), width);
    points(0, 1, 1);
    points(1, 0, 1);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
    gl.enableVertexAttribArray(2);
    gl.vertexAttribPointer(2, 1, gl.FLOAT, false, 0, 0);
    gl.vertexAttribDivisor(2, 0);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count - 1);
  }
}

// Pixel by pixel into a plain canvas: a pixel has the colour of the line that covers most of it. What a canvas strokes by itself
// takes a hundred times as long where lines cross each other often.
class Scan {
  constructor(context) {
    Object.assign(this, { context, image: null });
  }

  forget() {}

  paint(lines, first, isAnew, view, colours, width) {
    const { width: wide, height: high } = lines.canvas;
    if (!this.image || this.image.width !== wide || this.image.height !== high) {
      this.image = new ImageData(wide, high);
      this.pixels = new Uint32Array(this.image.data.buffer);
    } else if (isAnew) this.pixels.fill(0);
    [this.top, this.bottom] = isAnew ? [0, high] : [high, 0];
    const { ratio } = view, half = Math.max(width, 1) * ratio / 2, byte = (part) => Math.round(part * 255);
    const inks = colours.map(([r, g, b]) => byte(b) << 16 | byte(g) << 8 | byte(r)), covers = colours.map((colour) => byte(colour[3]));
    strokes(lines, first, view, (x0, y0, x1, y1, shade) => this.line(x0 * ratio, y0 * ratio, x1 * ratio, y1 * ratio, half, inks[shade], covers[shade]));
    if (this.top < this.bottom) this.context.putImageData(this.image, 0, 0, 0, this.top, wide, this.bottom - this.top);
  }

  line(x0, y0, x1, y1, half, ink, cover) {
    const { pixels } = this, { width: wide, height: high } = this.image, dx = x1 - x0, dy = y1 - y0;
    const isFlat = Math.abs(dx) >= Math.abs(dy), long = isFlat ? dx : dy, slope = long === 0 ? 0 : (isFlat ? dy : dx) / long;
    const start = isFlat ? x0 : y0, side = isFlat ? y0 : x0, reach = half * Math.hypot(1, slope);
    const [size, breadth, alongBy, asideBy] = isFlat ? [wide, high, 1, wide] : [high, wide, wide, 1];
    let first = Math.min(start, start + long), last = Math.max(start, start + long);
    // What lies aside of the picture need not be gone along.
    if (slope !== 0) {
      const ends = [start + (-reach - side) / slope, start + (breadth + reach - side) / slope];
      first = Math.max(first, Math.min(...ends));
      last = Math.min(last, Math.max(...ends));
    } else if (side < -reach || side > breadth + reach) return;
    first = Math.max(Math.floor(first), 0);
    last = Math.min(Math.floor(last), size - 1);
    for (let place = first; place <= last; place++) {
      const middle = side + (place + 0.5 - start) * slope, from = middle - reach, to = middle + reach;
      const most = Math.min(Math.floor(to), breadth - 1);
      for (let aside = Math.max(Math.floor(from), 0); aside <= most; aside++) {
        const share = Math.min(to, aside + 1) - Math.max(from, aside), at = place * alongBy + aside * asideBy, near = cover * share;
        if (near >= pixels[at] >>> 24) pixels[at] = near << 24 | ink;
      }
    }
    const [low, up] = y0 < y1 ? [y0, y1] : [y1, y0];
    this.top = Math.max(Math.min(this.top, Math.floor(low - reach)), 0);
    this.bottom = Math.min(Math.max(this.bottom, Math.ceil(up + reach) + 1), high);
  }
}

// The lines from a point on as they are seen, px, with their colours.
function strokes({ values, count }, first, { right, up, centre, scale, width, height, below }, tell) {
  let px = 0, py = 0;
  for (let i = first; i < count; i++) {
    const at = i * POINT_NUMBERS, dx = values[at] - centre[0], dy = values[at + 1] - centre[1], dz = values[at + 2] - centre[2];
    const x = width / 2 + (right[0] * dx + right[1] * dy + right[2] * dz) * scale;
    const y = height / 2 + below - (up[0] * dx + up[1] * dy + up[2] * dz) * scale;
    const shade = i === first ? NO_LINE : values[at + 3];
    if (shade < 0) { px = x; py = y; continue; }
    const next = i + 1 < count ? values[at + 7] : NO_LINE;
    if (next === shade && Math.abs(x - px) + Math.abs(y - py) < LEAST_STROKE) continue;
    tell(px, py, x, y, shade);
    px = x; py = y;
  }
}
