// Before anything is drawn: the theme that was chosen here, else that of the system.
(() => {
  const asked = new URLSearchParams(location.hash.slice(1)).get("theme");
  const kept = asked || localStorage.getItem("theme");
  const dark = kept ? kept === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = dark ? "dark" : "light";
})();
