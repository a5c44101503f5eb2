// Round steps for an axis: about `count` ticks from low to high.
function ticks(low, high, count) {
  const raw = (high - low) / Math.max(count, 1);
  if (!(raw > 0) || !isFinite(raw)) return [];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
  const places = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; k++) places.push(k * step);
  return places;
}

// The ticks as text, all with the decimals that their distance needs.
function tickLabels(places) {
  const step = places.length > 1 ? places[1] - places[0] : Math.abs(places[0]) || 1;
  const largest = Math.max(...places.map(Math.abs));
  if (largest >= 1e5) return places.map((p) => thousands(p, step));
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const plain = places.map((p) => minus((Math.abs(p) < step * 1e-6 ? 0 : p).toFixed(decimals)));
  if (largest > 1e-3 || Math.max(...plain.map((text) => text.length)) < 9) return plain;
  return places.map((p) => (Math.abs(p) < step * 1e-6 ? "0" : minus(p.toExponential(1))));
}

function thousands(value, step) {
  const [unit, mark] = Math.abs(value) >= 1e6 || step >= 1e6 ? [1e6, "M"] : [1e3, "k"];
  return value === 0 ? "0" : minus(String(Number((value / unit).toPrecision(4)))) + mark;
}

function minus(text) {
  return text.replace("-", "\u2212");
}

// A value with about four significant digits.
function number(value) {
  if (!isFinite(value)) return "–";
  if (Math.abs(value) >= 1e6) return thousands(value, 1e6);
  const magnitude = Math.floor(Math.log10(Math.max(Math.abs(value), 1e-9)));
  const decimals = Math.min(Math.max(3 - magnitude, 0), 5);
  const rounded = Number(value.toFixed(decimals));
  return minus(String(rounded === 0 ? 0 : rounded));
}

function seconds(t, span) {
  return t.toFixed(span < 0.05 ? 5 : span < 5 ? 4 : 3) + " s";
}
