// The program around the line that moves, where its text is known to this page.
import { machine, onFrame } from "./machine.js";
import { element } from "./words.js";

const AROUND = 2;
let name = null;
let lines = [];
let shown = "";

export function showText(of, text) {
  name = of;
  lines = text === null ? [] : text.split(/\r?\n/);
  shown = "";
  draw();
}

export function textView() {
  machine.on("status", onFrame(draw));
}

function draw() {
  const { status } = machine;
  const place = document.getElementById("text");
  const isShown = status && status.program === name && lines.length > 0;
  const line = isShown && status.job === "program" ? status.line : 0;
  const key = isShown ? `${name}:${line}` : "";
  if (key === shown) return;
  shown = key;
  const first = Math.min(Math.max(line - 1 - AROUND, 0), Math.max(lines.length - 3, 0));
  place.replaceChildren(...(isShown ? lines.slice(first, first + 3) : []).flatMap((words, at) => {
    const number = first + at + 1;
    const row = `${String(number).padStart(6, " ")}  ${words}`;
    return [number === line ? element("b", {}, row) : row, "\n"];
  }));
}
