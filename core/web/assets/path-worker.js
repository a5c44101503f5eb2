// Draws the path beside the page: a graphics unit that is slow, or a processor that stands in for one, never holds up a button.
importScripts("view/lines.js");

// The programmed path, and above it what was driven of it.
const pictures = {};
let asked = null, pending = false;
// Points that were put into the picture, those that were painted again among them.
let painted = 0;

onmessage = ({ data }) => {
  try { hear(data); } catch (error) { postMessage({ failed: error.message }); }
};

function hear({ canvases, clear, add, draw }) {
  if (canvases) for (const [name, canvas] of Object.entries(canvases)) pictures[name] = new Lines(canvas);
  for (const name of clear || []) pictures[name].clear();
  for (const [name, points] of Object.entries(add || {})) pictures[name].add(points);
  if (draw) asked = draw;
  if (!asked || pending) return;
  pending = true;
  requestAnimationFrame(paint);
}

// Places of the machine that are kept, of which it then keeps every second one.
const MAX_DRIVEN = 1 << 18;

function paint() {
  pending = false;
  const { programmed, driven } = pictures;
  const { view, colours, isMoving } = asked;
  if (driven.count > MAX_DRIVEN) driven.halve();
  const before = programmed.drawn;
  painted += programmed.draw(view, colours, 1.6, isMoving);
  driven.draw(view, colours, 2.4, isMoving);
  if (programmed.drawn !== before) programmed.finish();
  postMessage({ drawn: programmed.drawn, painted });
}
