/** Mouse, pen or touch on the view from above: one drags the hand, two fingers or the wheel lift it.
 *
 * However many fingers there are, there is one hand: a second finger stops it where it is, and whichever finger stays
 * last drags it on from there. It never jumps to a finger that was already down.
 */

const LIFT_PER_PX = 0.005;
const LIFT_PER_NOTCH = 0.06;
const GRAB_PX = 36;

/** @typedef {object} Reach what a drag may do
 * @property {() => import("../view/camera.js").TopCamera | null} camera
 * @property {() => readonly number[]} hand where the hand is now
 * @property {() => readonly number[]} wanted where it is called to
 * @property {() => boolean} take called when a drag begins; whether it may have the hand
 * @property {(x: number, y: number) => void} goTo
 * @property {(metres: number) => void} lift
 */

/** Turns pointers into places. */
export class Drag {
  /** @type {Map<number, {x: number, y: number}>} */
  #pointers = new Map();
  /** From the pointer to the hand that it holds, px. */
  #offset = { x: 0, y: 0 };
  #surface;
  #reach;

  /** @param {HTMLElement} surface @param {Reach} reach */
  constructor(surface, reach) {
    this.#surface = surface;
    this.#reach = reach;
    surface.addEventListener("pointerdown", (event) => this.#press(event));
    surface.addEventListener("pointermove", (event) => this.#move(event));
    for (const end of /** @type {const} */ (["pointerup", "pointercancel"])) {
      surface.addEventListener(end, (event) => this.#lift(event));
    }
    surface.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
  }

  /** @param {PointerEvent} event */
  #press(event) {
    if (event.button !== 0 || !this.#reach.take()) {
      return;
    }
    this.#surface.setPointerCapture(event.pointerId);
    this.#pointers.set(event.pointerId, place(event));
    if (this.#pointers.size === 1) {
      const offset = this.#toHand(place(event), this.#reach.hand());
      this.#offset = Math.hypot(offset.x, offset.y) < GRAB_PX ? offset : { x: 0, y: 0 };
      this.#follow(place(event));
    } else if (this.#pointers.size === 2) {
      const [x, y] = this.#reach.hand();
      this.#reach.goTo(x, y);
    }
  }

  /** The finger that is left holds the hand by where it is. @param {PointerEvent} event */
  #lift(event) {
    this.#pointers.delete(event.pointerId);
    const [left] = this.#pointers.values();
    if (left !== undefined) {
      this.#offset = this.#toHand(left, this.#reach.wanted());
    }
  }

  /** @param {{x: number, y: number}} pointer @param {readonly number[]} point @returns {{x: number, y: number}} px */
  #toHand(pointer, point) {
    const [x, y] = this.#reach.camera()?.toScreen(point) ?? [pointer.x, pointer.y];
    return { x: x - pointer.x, y: y - pointer.y };
  }

  /** @param {PointerEvent} event */
  #move(event) {
    const before = this.#pointers.get(event.pointerId);
    if (before === undefined) {
      return;
    }
    const now = place(event);
    this.#pointers.set(event.pointerId, now);
    if (this.#pointers.size > 1) {
      this.#reach.lift(((before.y - now.y) * LIFT_PER_PX) / this.#pointers.size);
    } else {
      this.#follow(now);
    }
  }

  /** @param {{x: number, y: number}} pointer */
  #follow({ x, y }) {
    const camera = this.#reach.camera();
    if (camera) {
      this.#reach.goTo(...camera.toWorld(x + this.#offset.x, y + this.#offset.y));
    }
  }

  /** @param {WheelEvent} event */
  #wheel(event) {
    event.preventDefault();
    this.#reach.lift(-Math.sign(event.deltaY) * LIFT_PER_NOTCH);
  }
}

/** @param {PointerEvent} event @returns {{x: number, y: number}} within the surface, px */
function place(event) {
  return { x: event.offsetX, y: event.offsetY };
}
