// The programmed path, and what was driven of it, as the controller tells them: numbers that go on to a worker, which draws. Here
// are the view, and what stands around the path.
import { machine, onFrame } from "./machine.js";
import { text } from "./words.js";

const COLOURS = ["faint", "rapid", "grid", "soft", "good", "line"];
const [FEED, RAPID, GRID, BOX, DRIVEN, EDGE] = [0, 1, 2, 3, 4, 5];
const NO_LINE_HERE = -1;
// What a packed path says of each point.
const KINDS = [FEED, RAPID, NO_LINE_HERE];
const STILL_AFTER_MS = 140;

const at = (id) => document.getElementById(id);
const camera = new Camera();
let worker, over, draw;
let generation = null, fetched = 0, drivenFrom = 0, box = null, fetching = false;
let movedAt = 0, wasFitted = false, fittedOf = null;

export function pathView() {
  over = at("path-over");
  const canvases = {};
  try {
    for (const name of ["programmed", "driven"]) canvases[name] = at("path-" + name).transferControlToOffscreen();
    worker = new Worker("path-worker.js");
  } catch (error) {
    text("path-note", `This browser draws no path: ${error.message}`);
    return;
  }
  worker.postMessage({ canvases }, Object.values(canvases));
  worker.onmessage = ({ data }) => {
    if (data.failed) text("path-note", `The path cannot be drawn: ${data.failed}`);
    else Object.assign(machine, { drawnPoints: data.drawn - groundPoints, paintedPoints: data.painted });
  };
  draw = onFrame(drawAll);
  const moved = () => { movedAt = performance.now(); draw(); setTimeout(draw, STILL_AFTER_MS + 20); };
  camera.listen(over, moved);
  over.addEventListener("dblclick", fit);
  at("fit").addEventListener("click", fit);
  for (const button of at("views").children) {
    button.addEventListener("click", () => { camera.show(button.dataset.view); press(); fit(); });
  }
  press();
  machine.on("described", () => { begin(null); fit(); });
  machine.on("status", onFrame(follow));
  machine.on("theme", draw);
  machine.link.on("away", () => { generation = null; });
  new ResizeObserver(() => {
    [camera.width, camera.height] = [over.clientWidth, over.clientHeight];
    if (!wasFitted) fit();
    draw();
  }).observe(over);
}

function press() {
  for (const button of at("views").children) button.setAttribute("aria-pressed", String(button.dataset.view === camera.name));
}

// The axes that span space: X, Y and Z where the machine has them, else its first linear ones.
function spaceAxes() {
  const { axes } = machine.described;
  const named = ["x", "y", "z"].map((letter) => axes.find((axis) => axis.axis === letter));
  if (named.some(Boolean)) return named;
  const linear = axes.filter((axis) => axis.unit === "mm");
  return [0, 1, 2].map((place) => linear[place]);
}

function spaceNames() {
  return machine.described ? spaceAxes().map((axis, place) => (axis ? axis.axis : "xyz"[place]).toUpperCase()) : ["X", "Y", "Z"];
}

function pointOf(position) {
  return spaceAxes().map((axis) => (axis ? position[machine.key(axis)] : 0));
}

// An empty picture: the travel of the machine.
let groundPoints = 0;
function begin(next) {
  [generation, fetched, drivenFrom, box] = [next, 0, 0, null];
  if (!worker || !machine.described) return;
  const [low, high] = travel(), ground = [];
  const add = (from, to, kind) => ground.push(...from, NO_LINE_HERE, ...to, kind);
  const step = gridStep(Math.max(high[0] - low[0], high[1] - low[1]));
  for (let x = Math.ceil(low[0] / step) * step; x <= high[0]; x += step) add([x, low[1], low[2]], [x, high[1], low[2]], GRID);
  for (let y = Math.ceil(low[1] / step) * step; y <= high[1]; y += step) add([low[0], y, low[2]], [high[0], y, low[2]], GRID);
  const corner = (bits) => [0, 1, 2].map((axis) => (bits >> axis & 1 ? high : low)[axis]);
  for (let bits = 0; bits < 8; bits++) {
    for (const axis of [1, 2, 4]) if (!(bits & axis)) add(corner(bits), corner(bits | axis), bits & 4 || axis === 4 ? EDGE : BOX);
  }
  groundPoints = ground.length / 4;
  send({ clear: ["programmed", "driven"], add: { programmed: new Float32Array(ground) } });
  draw();
}

function send(told) {
  worker.postMessage(told, Object.values(told.add || {}).map((points) => points.buffer));
}

function travel() {
  const axes = spaceAxes();
  const ends = (name, other) => axes.map((axis) => (axis && Number.isFinite(axis[name]) ? axis[name] : other));
  return [ends("min", 0), ends("max", 0)];
}

function gridStep(size) {
  const power = 10 ** Math.floor(Math.log10(Math.max(size, 1) / 8));
  return power * [1, 2, 5, 10].find((m) => size / (power * m) <= 14);
}

function fit() {
  if (!machine.described || !worker) return;
  [camera.width, camera.height] = [over.clientWidth, over.clientHeight];
  camera.fit(box || travel());
  wasFitted = camera.width > 0;
  draw();
}

// A status has come: where the machine is, and whether there is more of the path.
function follow() {
  const { status, described } = machine;
  if (!status || !described || !worker) return;
  fetchPath(status.path);
  draw();
}

// Fetches what is not here yet, answer by answer; each is small, so that no task holds up the page.
async function fetchPath({ generation: now, points, driven_count: drivenCount }) {
  if (fetching) return;
  if (now !== generation) begin(now);
  if (fetched >= points && drivenFrom >= drivenCount) return;
  fetching = true;
  try {
    let told;
    do {
      told = await machine.link.ask("path", { packed: true, from: fetched, driven_from: drivenFrom });
      if (told.generation !== generation) begin(told.generation);
      take(told);
    } while (fetched < told.count || drivenFrom < told.driven_count);
    text("path-note", told.beyond ? `${told.beyond} blocks more are not drawn` : "");
  } catch { /* asked again with the next status */ } finally { fetching = false; }
}

function take(told) {
  const { axes, low, high, count } = told;
  const order = spaceAxes().map((axis) => (axis ? axes.indexOf(machine.key(axis)) : -1));
  const space = (values) => order.map((place) => (place < 0 ? 0 : values[place]));
  const kinds = bytesOf(told.kinds);
  const points = inSpace(told.points, order, axes.length, (index) => KINDS[kinds[index]]);
  const driven = inSpace(told.driven, order, axes.length, (index) => (drivenFrom + index === 0 ? NO_LINE_HERE : DRIVEN));
  fetched = told.from + points.length / 4;
  drivenFrom = told.driven_from + driven.length / 4;
  if (low) box = [space(low), space(high)];
  // The whole of a path is told with its first points, so that what comes later is drawn where it stays.
  if (box && count > 0 && fittedOf !== generation) { fittedOf = generation; fit(); }
  send({ add: { programmed: points, driven } });
  draw();
}

function bytesOf(text) {
  const binary = atob(text), bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

// Points of all axes as points of space, with what leads to each.
function inSpace(text, order, width, kindOf) {
  const values = new Float32Array(bytesOf(text).buffer), count = values.length / width;
  const points = new Float32Array(count * 4);
  for (let index = 0; index < count; index++) {
    for (let axis = 0; axis < 3; axis++) points[index * 4 + axis] = order[axis] < 0 ? 0 : values[index * width + order[axis]];
    points[index * 4 + 3] = kindOf(index);
  }
  return points;
}

function drawAll() {
  if (!worker || !(camera.width > 0)) return;
  const isMoving = performance.now() - movedAt < STILL_AFTER_MS;
  worker.postMessage({ draw: { view: camera.view(), colours: COLOURS.map((name) => rgba(colour(name))), isMoving } });
  const { context } = prepare(over);
  if (camera.isPlane) drawGrid(context, camera, spaceNames(), [0, 0, 0], false);
  else drawTriad(context, camera, spaceNames());
  drawScaleBar(context, camera);
  if (machine.status && machine.described) drawTool(context);
}

function drawTool(context) {
  const place = camera.screen(pointOf(machine.status.position));
  if (camera.name === "XY") { drawPlace(context, place); return; }
  const [x, y] = place;
  context.fillStyle = colour("ink");
  context.strokeStyle = colour("card");
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(x - 7, y - 20);
  context.lineTo(x + 7, y - 20);
  context.closePath();
  context.fill();
  context.stroke();
}
