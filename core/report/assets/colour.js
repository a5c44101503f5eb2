const THEMES = {
  light: {
    axes: { X: "#0b63c4", Y: "#d2660a", Z: "#0f8a6c", A: "#a03fa8", B: "#4a7f12", C: "#8a5a2b", U: "#4b7fb8", V: "#b98a3e", W: "#5b9e8e" },
    main: "#3a3fbf", second: "#a4acb7", map: [0, 0.9],
  },
  dark: {
    axes: { X: "#6cb0ff", Y: "#ffa657", Z: "#56d3a8", A: "#d79bf0", B: "#a5d65b", C: "#d0a078", U: "#93bde8", V: "#e0c080", W: "#8fd0c2" },
    main: "#a5a8ff", second: "#66717f", map: [0.22, 1],
  },
};

// Viridis: equal steps look equal, also to the colour-blind; it has no red, which means "too much" on this page.
const VIRIDIS = [
  [68, 1, 84], [72, 36, 117], [65, 68, 135], [53, 95, 141], [42, 120, 142], [33, 145, 140],
  [34, 168, 132], [66, 190, 113], [122, 209, 81], [189, 223, 38], [253, 231, 37],
];

const SHADES = 48;

function viridis(part) {
  const place = Math.min(Math.max(part, 0), 1) * (VIRIDIS.length - 1);
  const i = Math.min(Math.floor(place), VIRIDIS.length - 2);
  const mixed = VIRIDIS[i].map((c, k) => Math.round(c + (VIRIDIS[i + 1][k] - c) * (place - i)));
  return `rgb(${mixed.join()})`;
}

const theme = { name: "light", css: {}, shades: [] };

function themeInForce() {
  const wanted = new URLSearchParams(location.hash.slice(1)).get("theme");
  if (wanted === "light" || wanted === "dark") return wanted;
  return matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
}

// Canvases know nothing of style sheets: what they need is read from the style once.
function loadTheme() {
  theme.name = themeInForce();
  document.documentElement.dataset.theme = theme.name;
  const style = getComputedStyle(document.documentElement);
  for (const name of ["page", "card", "ink", "soft", "faint", "line", "grid", "accent", "bad", "warn", "select"]) {
    theme.css[name] = style.getPropertyValue("--" + name).trim();
  }
  const [from, to] = THEMES[theme.name].map;
  theme.shades = Array.from({ length: SHADES }, (_, k) => viridis(from + (to - from) * k / (SHADES - 1)));
}

function axisColour(letter) {
  return THEMES[theme.name].axes[letter] || theme.css.ink;
}

function shadeOf(value, low, high) {
  const part = high > low ? (value - low) / (high - low) : 0;
  return Math.min(Math.max(Math.floor(part * SHADES), 0), SHADES - 1);
}
