// Viridis: equal steps look equal, also to the colour-blind; it has no red, which means "too much" on this page.
const VIRIDIS = [
  [68, 1, 84], [72, 36, 117], [65, 68, 135], [53, 95, 141], [42, 120, 142], [33, 145, 140],
  [34, 168, 132], [66, 190, 113], [122, 209, 81], [189, 223, 38], [253, 231, 37],
];

const SHADES = 48;
// The part of the map that is seen on the page's ground.
const MAP = { light: [0, 0.9], dark: [0.22, 1] };

function viridis(part) {
  const place = Math.min(Math.max(part, 0), 1) * (VIRIDIS.length - 1);
  const i = Math.min(Math.floor(place), VIRIDIS.length - 2);
  return VIRIDIS[i].map((c, k) => Math.round(c + (VIRIDIS[i + 1][k] - c) * (place - i)));
}

// The shades of the theme in force, red, green, blue.
function shades() {
  const [from, to] = MAP[theme.name];
  return Array.from({ length: SHADES }, (_, k) => viridis(from + (to - from) * k / (SHADES - 1)));
}

function axisColour(letter) {
  return colour(letter.toLowerCase());
}

function shadeOf(value, low, high) {
  const part = high > low ? (value - low) / (high - low) : 0;
  return Math.min(Math.max(Math.floor(part * SHADES), 0), SHADES - 1);
}
