function byId(id) {
  return document.getElementById(id);
}

function readout() {
  const i = state.cursor, span = state.to - state.from;
  const parts = i === null
    ? [["selected", `${seconds(state.from, span)} – ${seconds(state.to, span)}`], ["", `${number(span)} s`]]
    : [["t", columns.t[i].toFixed(4) + " s"], ["line", columns.line[i]],
      ...about.axes.map((axis, k) => [axis.letter, minus(positionOf(k, i).toFixed(4))])];
  byId("readout").replaceChildren(...parts.flatMap(([name, value]) => [name + " ", element("b", "", value)]));
}

function makeViews(view) {
  const buttons = ["XY", "XZ", "YZ", "3D"].map((name) => {
    const button = element("button", "", name === "3D" ? "3-D" : name);
    button.onclick = () => showView(view, name, buttons);
    button.dataset.view = name;
    return button;
  });
  byId("views").append(...buttons);
  const wanted = new URLSearchParams(location.hash.slice(1)).get("view");
  showView(view, buttons.some((b) => b.dataset.view === wanted) ? wanted : flatView(view), buttons);
}

function showView(view, name, buttons) {
  buttons.forEach((button) => button.setAttribute("aria-pressed", button.dataset.view === name));
  const turn = name === "3D" ? "drag: turn · shift-drag: move" : "drag: move";
  byId("path-hint").textContent = `wheel: zoom · ${turn} · double-click: fit all`;
  view.show(name);
}

// The plane in which most happens.
function flatView(view) {
  const extent = view.points.map((values) => {
    const [low, high] = new Extremes(values).of(0, values.length);
    return high - low;
  });
  const least = extent.indexOf(Math.min(...extent));
  return extent[least] > 0.2 * Math.max(...extent) ? "3D" : ["YZ", "XZ", "XY"][least];
}

function makeColourChoice(view) {
  const choice = byId("colour-by");
  choice.append(...view.sources.map((source) => element("option", "", source.name)));
  choice.onchange = () => {
    view.source = view.sources[choice.selectedIndex];
    changed("look");
  };
}

function makeButtons(view) {
  byId("fit-all").onclick = () => view.fit(0, columns.t.length);
  byId("fit-window").onclick = () => view.fit(...selectedRange());
  byId("all-time").onclick = selectAllTime;
  const unit = byId("unit");
  unit.textContent = feedUnit();
  unit.onclick = () => {
    state.perMinute = !state.perMinute;
    unit.textContent = feedUnit();
    changed("look");
  };
  byId("go-to-line").onkeydown = (event) => event.key === "Enter" && goToLine(Number(event.target.value || NaN), view);
  byId("go-to-line").oninput = () => (byId("line-answer").hidden = true);
}

function goToLine(number, view) {
  const from = columns.line.indexOf(number), to = columns.line.lastIndexOf(number);
  const answer = byId("line-answer");
  answer.textContent = from < 0 ? lineAnswer(number) : "";
  answer.hidden = from >= 0;
  if (from >= 0) goToTime(columns.t[from], columns.t[to], view);
}

// Why there is nothing to go to.
function lineAnswer(number) {
  if (!Number.isInteger(number) || number < 1) return "a line is a whole number from 1 on";
  let before = 0, after = Infinity;
  for (const other of columns.line) {
    if (other < number) before = Math.max(before, other);
    else after = Math.min(after, other);
  }
  const near = [[before, before > 0], [after, after < Infinity]].filter(([, there]) => there).map(([other]) => other);
  return `nothing moves on line ${number}` + (near.length ? `; the next that move: ${near.join(", ")}` : "");
}

function goToTime(from, to, view) {
  const margin = Math.max((to - from) * 0.1, 0.01);
  selectTime(from - margin, to + margin);
  view.fit(...selectedRange());
}

function makeFindings(view) {
  const rows = document.querySelectorAll("#findings tr[data-from]");
  byId("findings").hidden = rows.length === 0;
  for (const row of rows) {
    row.onclick = () => goToTime(Number(row.dataset.from), Number(row.dataset.to), view);
    row.onkeydown = (event) => event.key === "Enter" && row.onclick();
  }
}

function listenToTheme() {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    followTheme();
    changed("look");
  });
}

function makeDrawings() {
  const plots = allPlots(), overview = new Overview(byId("overview"));
  const view = new PathView(byId("path-ground"), byId("path-lines"), byId("path"));
  byId("plots").append(...plots.map((plot) => plot.root));
  plots.forEach((plot) => plot.begin());
  on("window cursor look", (kinds) => plots.forEach((plot) => plot.draw(kinds)));
  on("window look", () => overview.draw());
  on("window look", drawTimeAxis);
  on("window cursor look", () => view.draw());
  on("window cursor look", readout);
  return view;
}

async function start() {
  await readColumns();
  if (columns.t.length === 0) {
    document.querySelector("main").replaceChildren(element("p", "", "This run has no samples."));
  } else {
    const view = makeDrawings();
    restoreTime();
    makeViews(view);
    makeColourChoice(view);
    makeButtons(view);
    makeFindings(view);
    listenToKeys();
    listenToTheme();
    addEventListener("resize", () => changed("look"));
    addEventListener("hashchange", restoreTime);
    redraw();
  }
  document.documentElement.dataset.ready = "1";
}

function showFailure(error) {
  reportError(error);
  const text = `The drawings need a newer browser, or this file is damaged (${error}).`;
  document.querySelector("header").append(element("p", "failure", text));
}

start().catch(showFailure);
