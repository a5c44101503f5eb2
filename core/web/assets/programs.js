// Part programs: those of the controller's folder and files of this computer; every error stands at its line.
import { bind, machine } from "./machine.js";
import { element, say } from "./words.js";
import { showText } from "./text.js";

// A message holds 8 MB; a program that is longer comes in parts.
const PART_CHARACTERS = 1 << 20;
const MAX_BYTES = 64 << 20;

export function programsPanel() {
  const list = element("ul", { class: "files" });
  const errors = element("ul", { class: "errors", role: "status" });
  const file = element("input", { type: "file", hidden: "", accept: ".ngc,.nc,.tap,.gcode,.txt", "aria-label": "A program of this computer" });
  const open = bind(element("button", { class: "grow" }, "Open a file…"), "load", () => file.click());
  const again = element("button", { class: "quiet", title: "Read the folder again", onclick: () => fill(list, errors) }, "↻");
  file.addEventListener("change", async () => {
    const [chosen] = file.files;
    file.value = "";
    if (!chosen) return;
    if (chosen.size > MAX_BYTES) { say(`${chosen.name} has ${chosen.size} bytes; ${MAX_BYTES} are allowed.`); return; }
    const text = await chosen.text();
    if (text.length < PART_CHARACTERS * 7) { await load({ text, name: chosen.name }, errors, text); return; }
    if (await upload(chosen.name, text)) { await load({ path: chosen.name }, errors, text); fill(list, errors); }
  });
  machine.on("described", () => fill(list, errors));
  return element("div", {}, element("div", { class: "row" }, open, again, file), errors, element("h2", {}, "On the controller"), list);
}

async function fill(list, errors) {
  try {
    const { programs } = await machine.link.ask("list");
    const rows = programs.map((program) => {
      const name = program.name || program;
      const size = program.bytes === undefined ? "" : program.bytes < 1e4 ? `${program.bytes} B` : `${Math.round(program.bytes / 1000)} kB`;
      const button = element("button", {}, name, element("span", {}, size));
      bind(button, "load", () => load({ path: name }, errors, null));
      return element("li", {}, button);
    });
    list.replaceChildren(...(rows.length ? rows : [element("li", { class: "hint" }, "The folder is empty.")]));
  } catch (error) {
    list.replaceChildren(element("li", { class: "hint" }, error.message));
  }
}

async function load(keys, errors, text) {
  errors.replaceChildren(element("li", { class: "hint" }, "Checking…"));
  try {
    const { warnings, blocks, length_mm } = await machine.link.ask("load", keys);
    const facts = `${blocks} blocks, ${length_mm.toFixed(1)} mm`;
    errors.replaceChildren(element("li", { class: "hint" }, facts), ...(warnings || []).map((words) => element("li", {}, words)));
    showText(keys.name || keys.path, text);
  } catch (error) {
    const told = error.told || {};
    const all = told.errors || error.message.replace(/^\d+ errors in the program: /, "").split("; ");
    errors.replaceChildren(...all.map((words) => element("li", {}, typeof words === "string" ? words : `line ${words.line}: ${words.message || words.why}`)));
  }
}

async function upload(name, text) {
  for (let at = 0; at < text.length; at += PART_CHARACTERS) {
    const more = at + PART_CHARACTERS < text.length;
    const done = await machine.ask("upload", { name, text: text.slice(at, at + PART_CHARACTERS), more, replace: true });
    if (!done) return false;
  }
  return true;
}
