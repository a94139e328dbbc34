/** Arrow keys move the hand, Page Up and Page Down lift it, space stops the motors wherever the focus is. */

/** @typedef {import("../model.js").Vector} Vector */

/** @type {Record<string, Vector>} key -> direction in the world; the operator looks along -x */
const DIRECTIONS = {
  ArrowUp: [-1, 0, 0],
  ArrowDown: [1, 0, 0],
  ArrowLeft: [0, -1, 0],
  ArrowRight: [0, 1, 0],
  PageUp: [0, 0, 1],
  PageDown: [0, 0, -1],
};

/** Which directions are held down. */
export class Keys {
  /** @type {Set<string>} */
  #down = new Set();

  /** @param {{take: () => void, stop: () => void}} reach */
  constructor(reach) {
    document.addEventListener("keydown", (event) => this.#press(event, reach), { capture: true });
    document.addEventListener("keyup", (event) => this.#release(event), { capture: true });
    window.addEventListener("blur", () => this.#down.clear());
  }

  /** @returns {Vector} */
  push() {
    /** @type {Vector} */
    const sum = [0, 0, 0];
    for (const key of this.#down) {
      DIRECTIONS[key].forEach((part, axis) => (sum[axis] += part));
    }
    return sum;
  }

  /** @param {KeyboardEvent} event @param {{take: () => void, stop: () => void}} reach */
  #press(event, reach) {
    if (event.target instanceof HTMLInputElement) {
      return;
    }
    if (event.key === " ") {
      event.preventDefault();
      reach.stop();
    } else if (event.key in DIRECTIONS && !event.altKey && !event.ctrlKey && !event.metaKey) {
      event.preventDefault();
      if (!event.repeat) {
        this.#down.add(event.key);
        reach.take();
      }
    }
  }

  /** A button takes space on the way up: that must not press it. @param {KeyboardEvent} event */
  #release(event) {
    this.#down.delete(event.key);
    if (event.key === " " && !(event.target instanceof HTMLInputElement)) {
      event.preventDefault();
    }
  }
}
