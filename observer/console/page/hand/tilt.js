/** A phone as the hand: tilting it pushes, from however it was held when that was switched on. */

/** @typedef {import("../model.js").Vector} Vector */

const DEAD_DEG = 4;
const FULL_DEG = 24;

/** Inclination of the device; off until asked for. */
export class Tilt {
  on = false;
  /** @type {{beta: number, gamma: number} | null} */
  #level = null;
  /** @type {Vector} */
  #push = [0, 0, 0];
  #listener = (/** @type {DeviceOrientationEvent} */ event) => this.#turn(event);

  /** @returns {string} why there is none, empty if there may be */
  static get missing() {
    if (!window.isSecureContext) {
      return "needs HTTPS (--tls)";
    }
    return "DeviceOrientationEvent" in window ? "" : "not on this device";
  }

  /** Switches on or off. @returns {Promise<string>} why it could not be switched on, else empty */
  async toggle() {
    if (this.on) {
      this.on = false;
      this.#push = [0, 0, 0];
      window.removeEventListener("deviceorientation", this.#listener);
      return "";
    }
    // Only iOS asks its user.
    const ask = /** @type {any} */ (DeviceOrientationEvent).requestPermission;
    if (ask && (await ask.call(DeviceOrientationEvent)) !== "granted") {
      return "not allowed";
    }
    this.on = true;
    this.#level = null;
    window.addEventListener("deviceorientation", this.#listener);
    return "";
  }

  /** @returns {Vector} */
  push() {
    return this.#push;
  }

  /** @param {DeviceOrientationEvent} event */
  #turn({ beta, gamma }) {
    if (beta === null || gamma === null) {
      return;
    }
    this.#level ??= { beta, gamma };
    const turned = (screen.orientation.angle * Math.PI) / 180;
    const [back, right] = [beta - this.#level.beta, gamma - this.#level.gamma];
    this.#push = [
      part(back * Math.cos(turned) - right * Math.sin(turned)),
      part(right * Math.cos(turned) + back * Math.sin(turned)),
      0,
    ];
  }
}

/** @param {number} degrees from level @returns {number} -1 to 1 */
function part(degrees) {
  const size = (Math.abs(degrees) - DEAD_DEG) / (FULL_DEG - DEAD_DEG);
  return Math.sign(degrees) * Math.min(1, Math.max(0, size));
}
