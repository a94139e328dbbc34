/** Mouse, pen or touch on the view from above: one drags the hand, a second finger or the wheel lifts it. */

const LIFT_PER_PX = 0.005;
const LIFT_PER_NOTCH = 0.06;
const GRAB_PX = 36;

/** @typedef {object} Reach what a drag may do
 * @property {() => import("../view/camera.js").TopCamera | null} camera
 * @property {() => readonly number[]} hand where the hand is now
 * @property {() => boolean} take called when a drag begins; whether it may have the hand
 * @property {(x: number, y: number) => void} goTo
 * @property {(metres: number) => void} lift
 */

/** Turns pointers into places. */
export class Drag {
  /** @type {Map<number, {x: number, y: number}>} */
  #pointers = new Map();
  /** From the pointer to the hand that it has grabbed, px. */
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
      surface.addEventListener(end, (event) => this.#pointers.delete(event.pointerId));
    }
    surface.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
  }

  /** @param {PointerEvent} event */
  #press(event) {
    if (event.button !== 0) {
      return;
    }
    this.#surface.setPointerCapture(event.pointerId);
    this.#pointers.set(event.pointerId, place(event));
    if (this.#pointers.size === 1 && this.#reach.take()) {
      this.#grab(place(event));
      this.#follow(place(event));
    }
  }

  /** A press near the hand grabs it where it is; elsewhere it calls the hand there.
   * @param {{x: number, y: number}} pointer */
  #grab(pointer) {
    const [x, y] = this.#reach.camera()?.toScreen(this.#reach.hand()) ?? [pointer.x, pointer.y];
    const offset = { x: x - pointer.x, y: y - pointer.y };
    this.#offset = Math.hypot(offset.x, offset.y) < GRAB_PX ? offset : { x: 0, y: 0 };
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
      this.#grab(now);
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
