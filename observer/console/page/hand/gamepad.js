/** A gamepad: the left stick moves the hand, the right one lifts it, buttons are orders (standard mapping). */

/** @typedef {import("../model.js").Vector} Vector */

const DEAD_ZONE = 0.12;
const ORDERS = ["FLY", "STOP", "HOLD", "GROUND"];

/** The first pad that is connected. */
export class Gamepads {
  /** @type {boolean[]} */
  #pressed = [];
  #order;

  /** @param {(wish: string) => void} order called when a button goes down */
  constructor(order) {
    this.#order = order;
  }

  /** @returns {string} its name, empty without one */
  get name() {
    return pad()?.id ?? "";
  }

  /** Looks at the pad once; buttons take effect. @returns {Vector} push of the sticks */
  poll() {
    const now = pad();
    if (now === null) {
      return [0, 0, 0];
    }
    ORDERS.forEach((wish, button) => {
      const pressed = now.buttons[button]?.pressed ?? false;
      if (pressed && !this.#pressed[button]) {
        this.#order(wish);
      }
      this.#pressed[button] = pressed;
    });
    return [stick(now.axes[1]), stick(now.axes[0]), -stick(now.axes[3])];
  }
}

/** @returns {Gamepad | null} */
function pad() {
  return navigator.getGamepads().find((one) => one?.connected) ?? null;
}

/** Leaves out what a stick at rest says. @param {number | undefined} axis -1 to 1 @returns {number} */
function stick(axis = 0) {
  const size = Math.max(0, Math.abs(axis) - DEAD_ZONE) / (1 - DEAD_ZONE);
  return Math.sign(axis) * Math.min(1, size);
}
