// Which plots a run has.

function feedScale() {
  return state.perMinute ? 60 : 1;
}

function feedUnit() {
  return state.perMinute ? "mm/min" : "mm/s";
}

function main() {
  return colour("main");
}

function second() {
  return colour("second");
}

function feedPlot() {
  const look = (key, label, colour) => ({ key, label, colour });
  const curves = [new Curve(columns.feed, null, look("feed", "path", main))];
  if (columns.programmed) curves.unshift(new Curve(columns.programmed, null, look("programmed", "programmed", second)));
  return new Plot({ title: "Feed", unit: feedUnit, scale: feedScale, curves, fromZero: true, major: true });
}

// One plot for the linear and one for the rotary axes: their units have nothing in common.
function axisPlots(title, column, what) {
  return ["mm", "deg"].flatMap((unit) => {
    const curves = about.axes.map((axis, i) => [axis, i]).filter(([axis, i]) => axis.unit === unit && columns[column + i])
      .map(([axis, i]) => axisCurve(axis, i, column, what));
    const least = Math.max(0, ...about.axes.filter((axis) => axis.unit === unit).map((axis) => what.smallest || axis.max_acceleration * (what.least || 1e-9)));
    return curves.length === 0 ? [] : [new Plot({ title, curves, least, ...what.plot(unit) })];
  });
}

function axisCurve(axis, i, column, what) {
  return new Curve(columns[column + i], columns["marks" + i], {
    key: "axis " + axis.letter, label: axis.letter, colour: () => axisColour(axis.letter), bit: what.bit,
    limit: what.limit ? axis[what.limit] : null, judged: what.judged !== false,
  });
}

function velocityPlots() {
  const plot = (unit) => ({ unit: () => (unit === "mm" ? feedUnit() : "deg/s"), scale: unit === "mm" ? feedScale : () => 1, major: true });
  return axisPlots("Velocity", "velocity", { bit: 1, limit: "max_velocity", plot });
}

function accelerationPlots() {
  const plot = (unit) => ({ unit: () => unit + "/s²", note: stepNote(unit), major: true });
  return axisPlots("Acceleration", "acceleration", { bit: 2, limit: "max_acceleration", plot });
}

function stepNote(unit) {
  const step = Math.max(0, ...about.axes.filter((axis) => axis.unit === unit).map((axis) => axis.speed_difference));
  if (step === 0) return "";
  return `finite differences; steps up to ${number(step)} ${unit}/s where blocks meet are allowed`;
}

function jerkPlots() {
  const judged = about.jerk_is_judged;
  const note = !judged && about.axes.some((axis) => axis.max_jerk !== null) ? "reported, not judged" : "";
  return axisPlots("Jerk", "jerk", { bit: 4, limit: "max_jerk", least: 1e-2, judged, plot: (unit) => ({ unit: () => unit + "/s³", note }) });
}

function deviationPlot() {
  if (!columns.deviation) return [];
  const curve = new Curve(columns.deviation, columns.offpath, {
    key: "deviation", label: "deviation", colour: main, limit: about.path_tolerance_mm, isTwoSided: false, bit: 1,
  });
  return [new Plot({ title: "Path deviation", unit: () => "µm", scale: () => 1000, curves: [curve], fromZero: true })];
}

function followingPlots() {
  // Below a hundredth of a µm or of a degree there is nothing to see.
  const plot = (unit) => (unit === "mm" ? { unit: () => "µm", scale: () => 1000, least: 1e-5 } : { unit: () => "deg", least: 1e-2 });
  return axisPlots("Following error", "following", { bit: 0, plot });
}

function sigmaPlot() {
  if (!columns.sigma) return [];
  const curve = new Curve(columns.sigma, null, { key: "sigma", label: "σ", colour: main });
  return [new Plot({ title: "Rate of program time", unit: () => "", curves: [curve], fixed: [0, 1.08] })];
}

function signalPlots() {
  // Signals of one unit are compared in one plot, as many as there are colours.
  const colours = [main, second, () => axisColour("Z")];
  const groups = [];
  about.signals.forEach((signal, k) => {
    let group = groups.find((g) => signal.unit !== "" && g.unit === signal.unit && g.curves.length < colours.length);
    if (!group) groups.push((group = { unit: signal.unit, names: [], curves: [] }));
    const colour = colours[group.curves.length];
    group.curves.push(new Curve(columns["signal" + k], null, { key: "signal " + k, label: signal.name, colour }));
    group.names.push(signal.name);
  });
  return groups.map((group) => new Plot({ title: group.names.join(", "), unit: () => group.unit, curves: group.curves }));
}

function allPlots() {
  return [
    feedPlot(), ...velocityPlots(), ...accelerationPlots(), ...jerkPlots(), ...bandPlot(), ...deviationPlot(), ...followingPlots(),
    ...sigmaPlot(), ...signalPlots(),
  ];
}
