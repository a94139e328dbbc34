/** The glove as the page shows it: lit fingers, the pattern's name and meaning, sound, rumble, cues as text. */

import { make, part, write } from "../dom.js";
import { HandFigure } from "../glove/figure.js";
import { Player } from "../glove/player.js";
import { rumble, vibrate } from "../glove/rumble.js";
import { Speaker } from "../glove/tones.js";

/** @type {Record<string, string>} pattern -> what it says */
const MEANINGS = {
  EI: "extended, growing",
  ED: "extended, shrinking",
  RI: "regular, growing",
  RD: "regular, shrinking",
  CI: "contracted, growing",
  CD: "contracted, shrinking",
  R: "displaced to the right",
  L: "displaced to the left",
  CR: "contracted: move right",
  CL: "contracted: move left",
  ER: "extended: move right",
  EL: "extended: move left",
  DRONE_LOST: "a drone is lost",
  HAND_STALE: "the hand is silent",
  FENCE: "at the fence",
  BLOCKED: "a drone is blocked",
  LOW_BATTERY: "a battery is low",
};

/**
 * @typedef {object} Event
 * @property {string} name
 * @property {string} outcome
 * @property {boolean} cue
 * @property {import("../glove/tones.js").Frame[]} frames
 * @property {number} elapsed
 */

/** Everything under the heading "Glove". */
export class GlovePanel {
  #figure = new HandFigure(part("fingers"));
  #player = new Player();
  #speaker = new Speaker();
  /** @type {import("../glove/tones.js").Frame | null} */
  #felt = null;
  #rumbles = false;
  /** Whether what is shown could not be felt. */
  #unfelt = false;

  constructor() {
    toggle(part("sound"), () => {
      this.#speaker.toggle();
      return this.#speaker.on;
    });
    toggle(part("rumble"), () => (this.#rumbles = !this.#rumbles));
  }

  /** Plays what the glove has begun, and a safety cue also if it could not: somebody has to feel, see or hear it.
   * @param {Event} event @param {number} now ms */
  hear({ name, outcome, cue, frames, elapsed }, now) {
    const unfelt = cue && outcome === "failed";
    if (outcome !== "started" && !unfelt) {
      return;
    }
    this.#unfelt = unfelt;
    this.#player.play(name, frames, now - 1000 * elapsed);
    this.#speaker.play(frames, elapsed);
    if (this.#rumbles) {
      vibrate(frames);
    }
  }

  /** Shows the present frame. @param {number} now ms */
  show(now) {
    const frame = this.#player.frameAt(now);
    this.#figure.show(frame);
    const name = frame ? this.#player.name : "";
    write(part("pattern-name"), name || "at rest");
    write(part("pattern-meaning"), `${MEANINGS[name] ?? ""}${name && this.#unfelt ? ", not felt: no glove" : ""}`);
    if (frame !== this.#felt && frame !== null && this.#rumbles) {
      rumble(frame);
    }
    this.#felt = frame;
  }
}

/**
 * Lists the safety cues; they are spoken when they change.
 * @param {{level: string, text: string}[]} notices
 */
export function showNotices(notices) {
  part("cues").replaceChildren(
    ...notices.map(({ level, text }) => make("li", text, level === "alarm" ? "danger" : "care")),
  );
}

/**
 * Makes a button that is either pressed or not.
 * @param {HTMLElement} button
 * @param {() => boolean} change does it, and returns whether it is on now
 */
export function toggle(button, change) {
  button.addEventListener("click", () => button.setAttribute("aria-pressed", String(change())));
}
