/** Which fingers vibrate now. */

/** @typedef {import("./tones.js").Frame} Frame */

/** Plays one pattern at a time; a new one replaces the one that plays. */
export class Player {
  /** @type {readonly Frame[]} */
  #frames = [];
  #start = 0;
  /** Name of the pattern that plays or has last played. */
  name = "";

  /**
   * Starts a pattern.
   * @param {string} name
   * @param {readonly Frame[]} frames
   * @param {number} now ms
   */
  play(name, frames, now) {
    this.name = name;
    this.#frames = frames;
    this.#start = now;
  }

  /** Ends what plays. */
  stop() {
    this.#frames = [];
  }

  /**
   * Finds the frame of a moment.
   * @param {number} now ms
   * @returns {Frame | null} null before the first and after the last
   */
  frameAt(now) {
    let end = this.#start;
    for (const frame of this.#frames) {
      end += frame.ms;
      if (now < end) {
        return frame;
      }
    }
    return null;
  }
}
