/** Dark or light: as the system says, until the operator chooses. */

const KEY = "swarmtouch-theme";
const system = matchMedia("(prefers-color-scheme: light)");

/**
 * Applies the theme now and whenever it changes.
 * @param {HTMLElement} button that switches
 * @param {() => void} changed called after every change
 */
export function followTheme(button, changed) {
  const apply = () => {
    document.documentElement.dataset.theme = localStorage.getItem(KEY) ?? (system.matches ? "light" : "dark");
    changed();
  };
  system.addEventListener("change", apply);
  button.addEventListener("click", () => {
    localStorage.setItem(KEY, document.documentElement.dataset.theme === "light" ? "dark" : "light");
    apply();
  });
  apply();
}
