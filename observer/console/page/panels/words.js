/** The swarm in words, for those who do not see the views. */

/** @typedef {import("../model.js").Model} Model */

/**
 * Describes where the hand and the drones are.
 * @param {Model} model
 * @param {boolean} bare whether the drones are hidden
 * @returns {string}
 */
export function describe(model, bare) {
  const { scene, snapshot } = model;
  if (scene === null || snapshot === null) {
    return "No swarm is heard.";
  }
  const hand = `Hand ${place(model.hand)}.`;
  if (bare) {
    return hand;
  }
  return [hand, ...snapshot.drones.map(sentence)].join(" ");
}

/** @param {import("../model.js").Drone} drone @returns {string} */
function sentence({ id, mode, position }) {
  return `Drone ${id}: ${mode.toLowerCase()}, ${place(position)}.`;
}

/** @param {readonly number[]} point @returns {string} as the operator looks: along -x, +y is right */
function place([x, y, z]) {
  const ahead = `${Math.abs(x).toFixed(1)} m ${x <= 0 ? "ahead" : "behind"}`;
  const aside = `${Math.abs(y).toFixed(1)} m ${y >= 0 ? "right" : "left"}`;
  return `${ahead}, ${aside}, ${z.toFixed(1)} m high`;
}
