/** Keeps the screen on while this page is the hand: one that goes dark is hidden, and lets go of it. */

/** Browsers allow that to secure pages only, and not to all of those. */
export class Awake {
  /** @type {WakeLockSentinel | null} */
  #lock = null;
  #wanted = false;

  /** @param {boolean} on */
  async keep(on) {
    this.#wanted = on;
    try {
      if (!on) {
        await this.#lock?.release();
        this.#lock = null;
      } else if (this.#lock === null || this.#lock.released) {
        this.#lock = (await navigator.wakeLock?.request("screen")) ?? null;
      }
    } catch {
      this.#lock = null; // the battery is low, or the page hidden: then it is as without
    }
    if (!this.#wanted && this.#lock) {
      this.keep(false);
    }
  }
}
