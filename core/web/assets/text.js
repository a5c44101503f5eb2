// The program that is loaded, around the line that moves: a part of its text is kept here, and another one is asked for where the
// line leaves it.
import { machine, onFrame } from "./machine.js";
import { element } from "./words.js";

const SHOWN = 3;
const KEPT = 200;
// What is kept begins as many lines before the one that moves: a program may go back a little.
const BEFORE = 20;

let part = { program_hash: null, from: 1, lines: [], count: 0 };
let isAsking = false;
let shown = "";

export function textView() {
  machine.on("status", onFrame(draw));
}

async function draw() {
  const { status } = machine;
  const hash = status ? status.program_hash : null;
  const line = hash && status.job === "program" ? status.line : 0;
  const wanted = Math.max(line, 1);
  const isKept = part.program_hash === hash && (part.count === 0 || (wanted >= part.from && wanted + 1 < part.from + part.lines.length) || reachesEnd());
  if (hash && !isKept && !isAsking) {
    isAsking = true;
    try { part = await machine.link.ask("text", { from: Math.max(wanted - BEFORE, 1), lines: KEPT }); } catch { /* asked again with the next status */ } finally { isAsking = false; }
  }
  show(hash && part.program_hash === hash ? line : null);
}

function reachesEnd() {
  return part.from + part.lines.length > part.count && machine.status.line >= part.from;
}

// The lines around this one; none where it is null, the first ones where nothing moves.
function show(line) {
  const key = line === null ? "" : `${part.program_hash}:${part.from}:${line}`;
  if (key === shown) return;
  shown = key;
  const last = Math.max(part.from + part.lines.length - SHOWN, part.from);
  const first = Math.min(Math.max(line - 1, part.from), last);
  const lines = line === null ? [] : part.lines.slice(first - part.from, first - part.from + SHOWN);
  document.getElementById("text").replaceChildren(...lines.flatMap((words, at) => {
    const row = `${String(first + at).padStart(6, " ")}  ${words}`;
    return [first + at === line ? element("b", {}, row) : row, "\n"];
  }));
}
