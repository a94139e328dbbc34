/** Patterns as vibration of what the operator holds: gamepads (left motor = thumb side) and phones. */

const THUMB_SIDE = [1, 2, 3];
const LITTLE_SIDE = [3, 4, 5];
const HIGHEST_HZ = 250;

/**
 * Says how strongly a side vibrates.
 * @param {import("./tones.js").Frame} frame
 * @param {readonly number[]} fingers of that side
 * @returns {number} 0 to 1
 */
function strength(frame, fingers) {
  return Math.min(1, Math.max(0, ...fingers.map((finger) => (frame.hz[finger] ?? 0) / HIGHEST_HZ)));
}

/**
 * Lets every connected gamepad feel a frame.
 * @param {import("./tones.js").Frame} frame
 */
export function rumble(frame) {
  for (const pad of navigator.getGamepads()) {
    // A pad that is just being unplugged refuses; there is nobody to tell.
    pad?.vibrationActuator
      ?.playEffect("dual-rumble", {
        duration: frame.ms,
        strongMagnitude: strength(frame, THUMB_SIDE),
        weakMagnitude: strength(frame, LITTLE_SIDE),
      })
      .catch(() => {});
  }
}

/**
 * Lets a phone feel a pattern: its one motor runs whenever a finger would.
 * @param {readonly import("./tones.js").Frame[]} frames
 */
export function vibrate(frames) {
  navigator.vibrate?.(pulses(frames));
}

/**
 * Joins frames into times of vibration and rest in turn, starting with vibration.
 * @param {readonly import("./tones.js").Frame[]} frames
 * @returns {number[]} ms
 */
export function pulses(frames) {
  /** @type {number[]} */
  const times = [0];
  for (const frame of frames) {
    const moves = Object.keys(frame.hz).length > 0;
    if (moves !== (times.length % 2 === 1)) {
      times.push(0);
    }
    times[times.length - 1] += frame.ms;
  }
  return times;
}
