import { connect, machine } from "./machine.js";
import { capturePanel } from "./capture.js";
import { controls } from "./controls.js";
import { historyPanel, offsetsPanel, toolsPanel } from "./tables.js";
import { jogPanel } from "./jog.js";
import { machinePanel } from "./machine-panel.js";
import { mdiPanel } from "./mdi.js";
import { pathView } from "./path.js";
import { programsPanel } from "./programs.js";
import { readouts } from "./readouts.js";
import { scopeView } from "./scope.js";
import { textView } from "./text.js";
import { tuningPanel } from "./tuning.js";
import { element } from "./words.js";

const PANELS = [
  ["jog", "Jog", jogPanel], ["mdi", "By hand", mdiPanel], ["programs", "Programs", programsPanel],
  ["offsets", "Offsets", offsetsPanel], ["tools", "Tools", toolsPanel], ["history", "Alarms", historyPanel],
  ["capture", "Scope", capturePanel], ["machine", "Machine", machinePanel], ["tuning", "Tuning", tuningPanel],
];

function panels() {
  const tabs = document.getElementById("tabs"), place = document.getElementById("panels");
  const choose = (name) => {
    for (const tab of tabs.children) {
      const chosen = tab.dataset.panel === name;
      tab.setAttribute("aria-selected", String(chosen));
      tab.tabIndex = chosen ? 0 : -1;
      document.getElementById("panel-" + tab.dataset.panel).hidden = !chosen;
    }
    localStorage.setItem("panel", name);
  };
  for (const [name, label, build] of PANELS) {
    tabs.append(element("button", { role: "tab", id: "tab-" + name, "data-panel": name, "aria-controls": "panel-" + name, onclick: () => choose(name) }, label));
    const panel = build();
    for (const [key, value] of [["role", "tabpanel"], ["id", "panel-" + name], ["aria-labelledby", "tab-" + name]]) panel.setAttribute(key, value);
    place.append(panel);
  }
  tabs.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowLeft: -1, ArrowDown: 3, ArrowUp: -3 }[event.key];
    if (!by) return;
    event.preventDefault();
    const all = [...tabs.children].filter((tab) => !tab.hidden), at = all.indexOf(document.activeElement);
    const next = all[(at + by + all.length) % all.length];
    choose(next.dataset.panel);
    next.focus();
  });
  // There until a policy with parameters is.
  document.getElementById("tab-tuning").hidden = true;
  const kept = localStorage.getItem("panel");
  choose(PANELS.some(([name]) => name === kept && name !== "tuning") ? kept : "jog");
}

connect();
readouts();
controls();
textView();
panels();
pathView();
scopeView();
window.tandem = machine;
