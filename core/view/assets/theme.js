// Before anything is drawn: the theme that the address asks for, else the one that was chosen here, else that of the system.
const theme = { name: "light", css: {}, isChosen: false };

function chosenTheme() {
  const asked = new URLSearchParams(location.hash.slice(1)).get("theme");
  // A file that is opened from a disk may have no store of its own.
  try { return asked || localStorage.getItem("theme"); } catch { return asked; }
}

function followTheme() {
  const chosen = chosenTheme();
  theme.isChosen = chosen === "dark" || chosen === "light";
  const dark = theme.isChosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  useTheme(dark ? "dark" : "light");
}

function useTheme(name) {
  theme.name = name;
  document.documentElement.dataset.theme = name;
  theme.css = {};
}

// A colour of the style sheet: canvases know nothing of style sheets.
function colour(name) {
  theme.css[name] ||= getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  return theme.css[name] || colour("ink");
}

// The same in the numbers that the graphics unit takes.
function rgba(css) {
  const number = parseInt(css.slice(1, 7), 16);
  return [(number >> 16 & 255) / 255, (number >> 8 & 255) / 255, (number & 255) / 255, 1];
}

followTheme();
