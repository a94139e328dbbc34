/** Where this page wants the hand: dragged to a place, or pushed at a speed. Pure. */

/** @typedef {import("../model.js").Vector} Vector */

/** The wanted hand; the console follows it within its limits of speed and acceleration. */
export class Steering {
  /** @type {Vector | null} null while this page does not hold the hand */
  point = null;
  /** @type {Vector} */
  #low = [0, 0, 0];
  /** @type {Vector} */
  #high = [0, 0, 0];
  #speed = 0;
  #yaw = 0;
  /** @type {[number, number] | null} where a drag calls the hand before this page has it */
  #called = null;
  /** How far that drag has lifted it meanwhile, m. */
  #lifted = 0;

  /** @param {{low: Vector, high: Vector, max_speed: number}} hand limits of the scene */
  limit({ low, high, max_speed }) {
    this.#low = low;
    this.#high = high;
    this.#speed = max_speed;
  }

  /**
   * Begins where the hand is, or where a drag has called it meanwhile.
   * @param {Vector} point m
   * @param {number} yaw rad; stays
   */
  begin([x, y, z], yaw) {
    this.#yaw = yaw;
    [x, y] = this.#called ?? [x, y];
    this.point = this.#inside([x, y, z + this.#lifted]);
    this.#forget();
  }

  /** Ends: this page holds the hand no longer. */
  end() {
    this.point = null;
    this.#forget();
  }

  #forget() {
    this.#called = null;
    this.#lifted = 0;
  }

  /**
   * Moves to a place at the same height.
   * @param {number} x m
   * @param {number} y m
   */
  goTo(x, y) {
    if (this.point) {
      this.point = this.#inside([x, y, this.point[2]]);
    } else {
      this.#called = [x, y];
    }
  }

  /** Moves up or down. @param {number} metres */
  lift(metres) {
    if (this.point) {
      this.point = this.#inside([this.point[0], this.point[1], this.point[2] + metres]);
    } else if (this.#called) {
      this.#lifted += metres;
    }
  }

  /**
   * Moves on at a speed.
   * @param {Vector} push per axis, -1 to 1, as a part of the largest speed
   * @param {number} seconds since the last call
   */
  advance(push, seconds) {
    if (this.point) {
      const length = Math.max(1, Math.hypot(...push));
      const [x, y, z] = this.point.map((value, axis) => value + (push[axis] / length) * this.#speed * seconds);
      this.point = this.#inside([x, y, z]);
    }
  }

  /** @returns {{type: "hand", point: Vector, yaw: number} | null} what the console is to be told */
  message() {
    return this.point && { type: "hand", point: this.point, yaw: this.#yaw };
  }

  /** @param {Vector} point @returns {Vector} */
  #inside([x, y, z]) {
    return [this.#clamp(x, 0), this.#clamp(y, 1), this.#clamp(z, 2)];
  }

  /** @param {number} value @param {0 | 1 | 2} axis @returns {number} */
  #clamp(value, axis) {
    return Math.min(this.#high[axis], Math.max(this.#low[axis], value));
  }
}

/**
 * Adds what several devices push.
 * @param {readonly Vector[]} pushes
 * @returns {Vector} per axis, -1 to 1
 */
export function together(pushes) {
  const sum = /** @type {Vector} */ ([0, 0, 0]);
  for (const push of pushes) {
    push.forEach((part, axis) => {
      sum[axis] = Math.min(1, Math.max(-1, sum[axis] + part));
    });
  }
  return sum;
}
