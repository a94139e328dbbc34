/** The colours of the style sheet, for the canvases. */

const NAMES = ["grid", "line", "ink", "soft", "accent", "danger-ink", "care", "obstacle", "field"];

/** @returns {Record<string, string>} name without dashes -> colour, as the style sheet has it now */
export function readPalette() {
  const style = getComputedStyle(document.documentElement);
  return Object.fromEntries(NAMES.map((name) => [name.replace("-", "_"), style.getPropertyValue(`--${name}`).trim()]));
}
