/** Patterns as sound: one tone per vibrating finger at its frequency, panned from the thumb to the little finger. */

/** @typedef {{ms: number, hz: Record<string, number>}} Frame which finger (1 = thumb) vibrates how fast */

const LOUDNESS = 0.22;
const RAMP_S = 0.006;
const WIDTH = 0.9;
const MIDDLE_FINGER = 3;

/**
 * Says where a finger is heard.
 * @param {number} finger 1 (thumb) to 5 (little)
 * @returns {number} -1 (left) to 1 (right)
 */
export function panOf(finger) {
  return ((finger - MIDDLE_FINGER) / 2) * WIDTH;
}

/**
 * Schedules a whole pattern.
 * @param {BaseAudioContext} context live or offline
 * @param {readonly Frame[]} frames
 * @param {number} start when the first frame starts, s on the clock of the context; what has passed is left out
 */
export function schedule(context, frames, start) {
  let end = start;
  for (const frame of frames) {
    const begin = Math.max(end, context.currentTime);
    end += frame.ms / 1000;
    for (const [finger, hz] of end > begin + 2 * RAMP_S ? Object.entries(frame.hz) : []) {
      tone(context, Number(finger), hz, begin, end);
    }
  }
}

/** Sound for the operator; silent until switched on by a gesture, as browsers demand. */
export class Speaker {
  /** @type {AudioContext | null} */
  #context = null;

  /** @returns {boolean} */
  get on() {
    return this.#context !== null;
  }

  /** Switches the sound on or off; what is playing ends. */
  toggle() {
    if (this.#context === null) {
      this.#context = new AudioContext();
    } else {
      this.#context.close();
      this.#context = null;
    }
  }

  /** @param {readonly Frame[]} frames @param {number} elapsed since the first began, s */
  play(frames, elapsed) {
    if (this.#context !== null) {
      schedule(this.#context, frames, this.#context.currentTime - elapsed);
    }
  }
}

/**
 * A triangle wave: small loudspeakers give its overtones where they cannot give 150 Hz.
 * @param {BaseAudioContext} context
 * @param {number} finger
 * @param {number} hz
 * @param {number} start
 * @param {number} end
 */
function tone(context, finger, hz, start, end) {
  const source = new OscillatorNode(context, { type: "triangle", frequency: hz });
  const level = new GainNode(context, { gain: 0 });
  const side = new StereoPannerNode(context, { pan: panOf(finger) });
  level.gain.setValueAtTime(0, start);
  level.gain.linearRampToValueAtTime(LOUDNESS, start + RAMP_S);
  level.gain.setValueAtTime(LOUDNESS, end - RAMP_S);
  level.gain.linearRampToValueAtTime(0, end);
  source.connect(level).connect(side).connect(context.destination);
  source.start(start);
  source.stop(end);
}
