// Straight lines through points of space, any number of them, in as many colours as SHADES. By WebGL 2, where a point costs 16
// bytes and what comes to a picture that stands is drawn above it, so that each line is drawn once; where a browser has no WebGL,
// by its plain canvas. Runs on a page and in a worker.
const MAX_COLOURS = 64;
// A point to which no line leads.
const NO_LINE = -1;
// Of more lines each is one pixel wide: without a graphics unit the processor draws them.
const MAX_WIDE = 60000;
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
// One pixel wide: a strip through the points, of which the last of a line says its colour.
const THIN = `#version 300 es
in vec4 to;
uniform vec3 right, up, centre; uniform vec2 size, shift; uniform float scale; uniform vec4 colours[${MAX_COLOURS}];
flat out vec4 colour;
void main() {
  vec3 p = to.xyz - centre;
  gl_Position = vec4((vec2(dot(right, p), dot(up, p)) * scale + shift) / size * 2.0, 0.0, 1.0);
  colour = to.w < 0.0 ? vec4(0.0) : colours[int(to.w)];
}`;
const FRAGMENT = `#version 300 es
precision mediump float; flat in vec4 colour; out vec4 shown; void main() { shown = vec4(colour.rgb * colour.a, colour.a); }`;

class Lines {
  constructor(canvas) {
    Object.assign(this, { canvas, count: 0, values: new Float32Array(0), drawn: 0, key: "" });
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.painter = gl ? new Graphics(gl) : new Plain(canvas.getContext("2d"));
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

  // Draws what is not in the picture yet; all of it where the view or a colour is another one. `thin` spares what it can. Answers
  // how many points it has painted.
  draw(view, colours, width, thin = false) {
    const { canvas } = this;
    const wide = Math.max(Math.round(view.width * view.ratio), 1), high = Math.max(Math.round(view.height * view.ratio), 1);
    const isThin = thin || this.count > MAX_WIDE;
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

class Graphics {
  constructor(gl) {
    this.gl = gl;
    this.thick = this.program(VERTEX);
    this.thin = this.program(THIN);
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
    const program = width ? this.thick : this.thin;
    gl.useProgram(program);
    const at = (name) => gl.getUniformLocation(program, name);
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
    if (!width) {
      points(0, 0, 0);
      gl.disableVertexAttribArray(1);
      gl.disableVertexAttribArray(2);
      gl.drawArrays(gl.LINE_STRIP, 0, count);
      return;
    }
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

class Plain {
  constructor(context) {
    this.context = context;
  }

  forget() {}

  // One stroke for each colour: a canvas is slow in changing colours, not in drawing lines. What is shorter than a pixel waits for
  // the next.
  paint({ values, count, canvas }, first, isAnew, view, colours, width) {
    const { context } = this, { right, up, centre, scale } = view;
    context.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    if (isAnew) context.clearRect(0, 0, canvas.width, canvas.height);
    const paths = colours.map(() => null);
    let px = 0, py = 0, pen = -2, ended = true;
    for (let i = first; i < count; i++) {
      const at = i * POINT_NUMBERS, x = values[at] - centre[0], y = values[at + 1] - centre[1], z = values[at + 2] - centre[2];
      const sx = view.width / 2 + (right[0] * x + right[1] * y + right[2] * z) * scale;
      const sy = view.height / 2 + view.below - (up[0] * x + up[1] * y + up[2] * z) * scale;
      const shade = i === first ? NO_LINE : values[at + 3];
      if (shade < 0) { px = sx; py = sy; ended = true; continue; }
      const next = i + 1 < count ? values[at + 7] : NO_LINE;
      if (next === shade && Math.abs(sx - px) + Math.abs(sy - py) < 0.6) continue;
      const path = paths[shade] ||= new Path2D();
      if (ended || pen !== shade) path.moveTo(px, py);
      path.lineTo(sx, sy);
      [px, py, pen, ended] = [sx, sy, shade, false];
    }
    context.lineWidth = width || 1;
    context.lineJoin = context.lineCap = "round";
    for (let shade = colours.length - 1; shade >= 0; shade--) {
      if (!paths[shade]) continue;
      const [r, g, b, a] = colours[shade];
      context.strokeStyle = `rgba(${r * 255}, ${g * 255}, ${b * 255}, ${a})`;
      context.stroke(paths[shade]);
    }
  }
}
