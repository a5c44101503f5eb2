// Part programs: those of the controller's folder and files of this computer; every error stands at its line.
import { bind, machine } from "./machine.js";
import { element, say } from "./words.js";

// A message holds 8 MB; a program that is longer comes in parts.
const PART_CHARACTERS = 1 << 20;
const MAX_BYTES = 64 << 20;

const list = element("ul", { class: "files" });
const told = element("ul", { class: "errors", role: "status" });

export function programsPanel() {
  const open = chooser("Open a file…", "load", "A program of this computer", async (name, text) => {
    if (text.length < PART_CHARACTERS * 7) await load("load", { text, name });
    else if (await upload(name, text, true)) await load("load", { path: name });
  });
  const keep = chooser("Upload…", "upload", "A program for the controller's folder", (name, text) => upload(name, text, false));
  const again = element("button", { class: "quiet", title: "Read the folder again", "aria-label": "Read the folder again", onclick: fill }, "↻");
  machine.on("described", fill);
  return element("div", {}, element("div", { class: "row" }, ...open, ...keep, again), told, element("h2", {}, "On the controller"), list);
}

// A button that asks for a file of this computer and hands over its name and text.
function chooser(label, request, what, take) {
  const file = element("input", { type: "file", hidden: "", accept: ".ngc,.nc,.tap,.gcode,.txt", "aria-label": what });
  file.addEventListener("change", async () => {
    const [chosen] = file.files;
    // A file that is as large is not even read.
    if (chosen && chosen.size > MAX_BYTES) say(`${chosen.name} has ${chosen.size} bytes; ${MAX_BYTES} are allowed.`);
    else if (chosen) await take(chosen.name, await chosen.text());
    file.value = "";
  });
  return [bind(element("button", { class: "grow" }, label), request, () => file.click()), file];
}

async function fill() {
  try {
    const { programs } = await machine.link.ask("list");
    const rows = programs.map(({ name, bytes }) => {
      const size = bytes < 1e4 ? `${bytes} B` : `${Math.round(bytes / 1000)} kB`;
      const button = bind(element("button", { class: "grow" }, element("b", {}, name), element("span", {}, size)), "load", () => load("load", { path: name }));
      const check = bind(element("button", { class: "quiet", "aria-label": `Check ${name}` }, "Check"), "check", () => load("check", { path: name }));
      return element("li", { class: "row" }, button, check);
    });
    list.replaceChildren(...(rows.length ? rows : [element("li", { class: "hint" }, "The folder is empty.")]));
  } catch (error) {
    list.replaceChildren(element("li", { class: "hint" }, error.message));
  }
}

// Loads a program, or checks it alone; what is wrong with it stands here.
async function load(request, keys) {
  const name = keys.name || keys.path;
  told.replaceChildren(element("li", { class: "hint" }, `Checking ${name}…`));
  try {
    const { warnings, blocks, length_mm } = await machine.link.ask(request, keys);
    const facts = `${name}: ${blocks} blocks, ${length_mm.toFixed(1)} mm${request === "check" ? ", nothing wrong" : ""}`;
    told.replaceChildren(element("li", { class: "hint" }, facts), ...(warnings || []).map((words) => element("li", {}, words)));
  } catch (error) {
    told.replaceChildren(...error.message.replace(/^\d+ errors in the program: /, "").split("; ").map(errorRow));
  }
}

// Behind the words of an error come the line that it speaks of, and marks below what is meant.
function errorRow(words) {
  const [said, ...lines] = words.split("\n");
  return element("li", {}, said, ...(lines.length ? [element("pre", { tabindex: "0" }, lines.join("\n"))] : []));
}

// Puts a program into the controller's folder; where one of its name is there, only a second press replaces it.
async function upload(name, text, replace) {
  try {
    let at = 0;
    do {
      const more = at + PART_CHARACTERS < text.length;
      await machine.link.ask("upload", { name, text: text.slice(at, at + PART_CHARACTERS), more, replace });
      at += PART_CHARACTERS;
    } while (at < text.length);
    told.replaceChildren(element("li", { class: "hint" }, `${name} is on the controller.`));
    await fill();
    return true;
  } catch (error) {
    const isThere = !replace && error.message.includes("is there already");
    const button = element("button", { onclick: () => upload(name, text, true) }, `Replace ${name}`);
    told.replaceChildren(element("li", {}, isThere ? `${name} is there already.` : error.message), ...(isThere ? [element("li", {}, button)] : []));
    return false;
  }
}
