/** The operator's right hand seen from its back: five fingertips that light up with what the glove does. */

const SVG = "http://www.w3.org/2000/svg";
const STRONGEST_HZ = 250;
const REST_RADIUS = 7.5;
const FULL_RADIUS = 12.5;

/** Finger -> knuckle and tip, in units of the drawing. */
const LIMBS = [
  { finger: 1, from: [74, 146], tip: [28, 104] },
  { finger: 2, from: [84, 104], tip: [72, 42] },
  { finger: 3, from: [110, 100], tip: [108, 24] },
  { finger: 4, from: [136, 104], tip: [144, 38] },
  { finger: 5, from: [158, 118], tip: [178, 68] },
];

/** The drawing, and what it shows. */
export class HandFigure {
  /** @type {Map<number, {group: Element, tip: Element, text: Element}>} */
  #fingers = new Map();
  /** @type {import("./tones.js").Frame | null} */
  #shown = null;

  /** @param {Element} parent where the drawing goes */
  constructor(parent) {
    const name = "Right hand, seen from its back";
    const drawing = shape("svg", { viewBox: "0 -8 206 200", role: "img", "aria-label": name });
    const edges = LIMBS.map(({ from, tip }) => limb("finger-edge", from, tip));
    const limbs = LIMBS.map(({ from, tip }) => limb("finger-limb", from, tip));
    const palm = "M72 106Q118 82 171 123C170 150 164 168 152 190L92 190Q82 170 65 156Z";
    drawing.append(...edges, shape("path", { class: "hand-shape", d: palm }), ...limbs);
    for (const { finger, tip } of LIMBS) {
      drawing.append(this.#fingertip(finger, tip));
    }
    parent.append(drawing);
  }

  /**
   * Lights the fingers of a frame: larger is stronger, and the frequency stands above.
   * @param {import("./tones.js").Frame | null} frame
   */
  show(frame) {
    if (frame === this.#shown) {
      return;
    }
    this.#shown = frame;
    for (const [finger, { group, tip, text }] of this.#fingers) {
      const hz = frame?.hz[finger];
      text.textContent = hz ? String(hz) : "";
      tip.setAttribute("r", String(hz ? FULL_RADIUS * Math.min(1, hz / STRONGEST_HZ) : REST_RADIUS));
      if (hz) {
        group.setAttribute("data-hz", String(hz));
      } else {
        group.removeAttribute("data-hz");
      }
    }
  }

  /** @param {number} finger @param {number[]} place @returns {Element} */
  #fingertip(finger, [x, y]) {
    const group = shape("g", { class: "finger", "data-finger": finger });
    const tip = shape("circle", { class: "finger-tip", cx: x, cy: y, r: REST_RADIUS });
    const text = shape("text", { class: "finger-hz", x, y: y - 19 });
    group.append(shape("circle", { class: "finger-rest", cx: x, cy: y, r: REST_RADIUS }), tip, text);
    this.#fingers.set(finger, { group, tip, text });
    return group;
  }
}

/** @param {string} kind @param {number[]} from @param {number[]} tip @returns {Element} */
function limb(kind, from, tip) {
  return shape("path", { class: kind, d: `M${from.join(" ")}L${tip.join(" ")}` });
}

/** @param {string} name @param {Record<string, string | number>} attributes @returns {Element} */
function shape(name, attributes) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) {
    element.setAttribute(key, String(value));
  }
  return element;
}
