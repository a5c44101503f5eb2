// Straight lines of space by WebGL 2, any number of them: each is a rectangle of the screen that the graphics unit makes from its
// ends. While the view moves they are drawn one pixel wide, which costs a fraction.
const VERTEX = `#version 300 es
in vec4 from; in vec4 to; in float corner;
uniform vec3 right, up, centre; uniform vec2 size, shift; uniform float scale, width; uniform vec4 colours[4];
out vec4 colour;
vec2 place(vec3 p) { p -= centre; return vec2(dot(right, p), dot(up, p)) * scale + shift; }
void main() {
  vec2 a = place(from.xyz), b = place(to.xyz), along = b - a;
  float length = max(length(along), 1e-6);
  vec2 aside = vec2(-along.y, along.x) / length * width * 0.5;
  float end = corner < 2.0 ? 0.0 : 1.0, side = mod(corner, 2.0) * 2.0 - 1.0;
  vec2 p = mix(a, b, end) + aside * side + along / length * width * 0.25 * (end * 2.0 - 1.0);
  gl_Position = vec4(p / size * 2.0, 0.0, 1.0);
  colour = colours[int(from.w)];
}`;
const THIN = `#version 300 es
in vec4 from;
uniform vec3 right, up, centre; uniform vec2 size, shift; uniform float scale; uniform vec4 colours[4];
out vec4 colour;
void main() {
  vec3 p = from.xyz - centre;
  gl_Position = vec4((vec2(dot(right, p), dot(up, p)) * scale + shift) / size * 2.0, 0.0, 1.0);
  colour = colours[int(from.w)];
}`;
const FRAGMENT = `#version 300 es
precision mediump float; in vec4 colour; out vec4 shown; void main() { shown = vec4(colour.rgb * colour.a, colour.a); }`;
const BYTES = 32;
const MIN_ROOM = 4096;

export class Lines {
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: false });
    if (!gl) throw new Error("this browser draws no WebGL 2");
    Object.assign(this, { canvas, gl, count: 0, room: 0, values: new Float32Array(0), sent: 0 });
    this.thick = this.program(VERTEX);
    this.thin = this.program(THIN);
    this.corners = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([0, 1, 2, 3]), gl.STATIC_DRAW);
    this.buffer = gl.createBuffer();
    this.thickState = this.layout(this.thick, true);
    this.thinState = this.layout(this.thin, false);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
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
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) || "the shader is refused");
    return program;
  }

  layout(program, perLine) {
    const { gl } = this;
    const state = gl.createVertexArray();
    gl.bindVertexArray(state);
    const bind = (name, size, stride, offset, divisor) => {
      const place = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, stride, offset);
      gl.vertexAttribDivisor(place, divisor);
    };
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    if (perLine) {
      bind("from", 4, BYTES, 0, 1);
      bind("to", 4, BYTES, 16, 1);
      gl.bindBuffer(gl.ARRAY_BUFFER, this.corners);
      bind("corner", 1, 4, 0, 0);
    } else bind("from", 4, 16, 0, 0);
    gl.bindVertexArray(null);
    return state;
  }

  clear() {
    this.count = this.sent = 0;
  }

  // A line of space in one of the colours.
  add(x0, y0, z0, x1, y1, z1, colour) {
    if ((this.count + 1) * 8 > this.values.length) {
      const more = new Float32Array(Math.max(MIN_ROOM, this.values.length * 2));
      more.set(this.values);
      this.values = more;
    }
    this.values.set([x0, y0, z0, colour, x1, y1, z1, colour], this.count * 8);
    this.count++;
  }

  draw(camera, colours, width, isMoving) {
    const { gl, canvas } = this;
    const ratio = window.devicePixelRatio || 1;
    const wide = Math.round(canvas.clientWidth * ratio), high = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    gl.viewport(0, 0, wide, high);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    if (this.count === 0) return;
    this.send();
    const program = isMoving ? this.thin : this.thick;
    gl.useProgram(program);
    gl.bindVertexArray(isMoving ? this.thinState : this.thickState);
    const at = (name) => gl.getUniformLocation(program, name);
    gl.uniform3fv(at("right"), camera.right);
    gl.uniform3fv(at("up"), camera.up);
    gl.uniform3fv(at("centre"), camera.centre);
    gl.uniform2f(at("size"), canvas.clientWidth, canvas.clientHeight);
    gl.uniform2f(at("shift"), 0, -14);
    gl.uniform1f(at("scale"), camera.scale);
    if (!isMoving) gl.uniform1f(at("width"), width);
    gl.uniform4fv(at("colours"), colours.flat());
    if (isMoving) gl.drawArrays(gl.LINES, 0, this.count * 2);
    else gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.count);
    gl.bindVertexArray(null);
  }

  // What the graphics unit does not have yet.
  send() {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    if (this.room < this.values.length) {
      this.room = this.values.length;
      gl.bufferData(gl.ARRAY_BUFFER, this.values, gl.DYNAMIC_DRAW);
    } else if (this.sent < this.count) {
      gl.bufferSubData(gl.ARRAY_BUFFER, this.sent * BYTES, this.values, this.sent * 8, (this.count - this.sent) * 8);
    }
    this.sent = this.count;
  }
}
