// What stands around a path: grid, triad, scale bar. Names are those of the axes that span space.
const FONT = "12px system-ui, 'Segoe UI', Roboto, 'Liberation Sans', Arial, sans-serif";

// A canvas in device pixels with a context in CSS pixels.
function prepare(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  const wide = Math.round(width * ratio), high = Math.round(height * ratio);
  if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = FONT;
  return { context, width, height };
}

function line(context, x0, y0, x1, y1) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

// Text that stays legible over lines.
function plate(context, text, x, y) {
  context.save();
  context.lineJoin = "round";
  context.lineWidth = 4;
  context.strokeStyle = colour("card");
  context.globalAlpha = 0.85;
  context.strokeText(text, x, y);
  context.restore();
  context.fillText(text, x, y);
}

// Round positions of a plane, labelled at the left and at the bottom, with lines where nothing else has drawn them; `origin` is where
// space has its own.
function drawGrid(context, camera, names, origin = [0, 0, 0], hasLines = true) {
  const { width, height, scale } = camera;
  const [across, upward] = [camera.right, camera.up].map((direction) => direction.indexOf(1));
  const middle = (axis) => camera.centre[axis] + origin[axis];
  const u = middle(across), v = middle(upward);
  const us = ticks(u - width / 2 / scale, u + width / 2 / scale, width / 90);
  const vs = ticks(v - height / 2 / scale, v + height / 2 / scale, height / 70);
  context.strokeStyle = colour("grid");
  context.lineWidth = 1;
  const xs = us.map((place) => Math.round(width / 2 + (place - u) * scale) + 0.5);
  const ys = vs.map((place) => Math.round(height / 2 + BELOW_MIDDLE - (place - v) * scale) + 0.5);
  for (const x of hasLines ? xs : []) line(context, x, 0, x, height);
  for (const y of hasLines ? ys : []) line(context, 0, y, width, y);
  context.fillStyle = colour("faint");
  context.textAlign = "center";
  context.textBaseline = "bottom";
  tickLabels(us).forEach((label, k) => xs[k] > 74 && xs[k] < width - 130 && plate(context, label, xs[k], height - 4));
  context.textAlign = "left";
  context.textBaseline = "middle";
  tickLabels(vs).forEach((label, k) => ys[k] > 56 && ys[k] < height - 26 && plate(context, label, 6, ys[k]));
  context.textBaseline = "bottom";
  context.font = "600 13px system-ui, 'Liberation Sans', Arial, sans-serif";
  for (const [axis, arrow, x] of [[upward, "↑", 6], [across, "→", 36]]) {
    context.fillStyle = colour(names[axis].toLowerCase());
    plate(context, `${names[axis]} ${arrow}`, x, height - 4);
  }
  context.font = FONT;
}

// Where the axes point: the longer an arm, the more it lies in the plane of the screen.
function drawTriad(context, camera, names) {
  const origin = [44, camera.height - 40], arm = 28;
  context.lineWidth = 2;
  context.font = "600 13px system-ui, 'Liberation Sans', Arial, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  names.forEach((name, axis) => {
    const [x, y] = [camera.right[axis] * arm, -camera.up[axis] * arm];
    if (Math.hypot(x, y) < 3) return;
    context.strokeStyle = context.fillStyle = colour(name.toLowerCase());
    line(context, origin[0], origin[1], origin[0] + x, origin[1] + y);
    plate(context, name, origin[0] + x * 1.36, origin[1] + y * 1.36);
  });
  context.font = FONT;
}

function drawScaleBar(context, camera) {
  const length = roundBelow(110 / camera.scale);
  const right = camera.width - 16, left = right - length * camera.scale, y = camera.height - 12;
  context.strokeStyle = context.fillStyle = colour("soft");
  context.lineWidth = 1.5;
  line(context, left, y, right, y);
  line(context, left, y - 4, left, y + 4);
  line(context, right, y - 4, right, y + 4);
  context.textAlign = "right";
  context.textBaseline = "bottom";
  plate(context, lengthText(length), right, y - 5);
}

// The largest of 1, 2, 5, 10, 20, … that is not above `value`.
function roundBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].find((m) => m * power <= value) * power;
}

function lengthText(mm) {
  if (mm >= 1000) return number(mm / 1000) + " m";
  return mm >= 0.1 ? number(mm) + " mm" : number(mm * 1000) + " µm";
}

// A place on the path: a ring that is seen on every colour.
function drawPlace(context, [x, y]) {
  context.lineWidth = 2;
  context.strokeStyle = colour("card");
  context.fillStyle = colour("ink");
  context.beginPath();
  context.arc(x, y, 5, 0, 2 * Math.PI);
  context.fill();
  context.stroke();
}
