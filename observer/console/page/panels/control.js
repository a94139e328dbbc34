/** Who holds the hand, and what may be ordered. */

import { flies, STALE_S } from "../model.js";
import { onPress, part, write } from "../dom.js";

/** @typedef {import("../model.js").Model} Model */

/** @type {Record<string, string>} wish of the console's hand -> what its holder may do */
const ADVICE = {
  GROUND: "Take off when you are ready",
  HOLD: "Holding: press Fly to go on",
  STOP: "Motors stopped: start a new flight",
};

/** The card of the hand; what its buttons say goes to `send`. */
export class ControlPanel {
  #model;
  #send;
  #stop;
  /** Who has been told no: that page must ask anew to be shown again. @type {number | undefined} */
  #refused;

  /** @param {Model} model @param {(message: object) => void} send @param {() => void} stop stops all motors */
  constructor(model, send, stop) {
    this.#model = model;
    this.#send = send;
    this.#stop = stop;
    onPress(part("take"), () => send({ type: this.#releases ? "release" : "take" }));
    onPress(part("give"), () => send({ type: "give", to: model.asking[0] }));
    onPress(part("keep"), () => this.#keep());
    for (const button of orderButtons()) {
      onPress(button, () => this.order(button.dataset.order ?? ""));
    }
  }

  #keep() {
    this.#refused = this.#model.asking[0];
    this.show(true);
  }

  /** Says what the operator wants, and takes the hand for it if it is free. @param {string} wish */
  order(wish) {
    if (wish === "STOP") {
      this.#stop();
    } else if (this.reach()) {
      this.#send({ type: "wish", wish });
    }
  }

  /** Takes the hand if it is free. @returns {boolean} whether this page has it, or may now get it */
  reach() {
    const { mine, holder, scene } = this.#model;
    if (!mine && holder === null && scene?.can_steer) {
      this.#send({ type: "take" });
      return true;
    }
    return mine;
  }

  /** @returns {boolean} whether the button lets go or withdraws, instead of taking */
  get #releases() {
    const { mine, asking, scene } = this.#model;
    return mine || (scene !== null && asking.includes(scene.you));
  }

  /** Shows who holds the hand.
   * @param {boolean} open whether there is a connection
   * @param {string} [why] there is none, if the console has said so */
  show(open, why = "") {
    const { mine, asking, holder, scene } = this.#model;
    const steers = open && (scene?.can_steer ?? false);
    part("hand").dataset.mine = document.body.dataset.holding = String(mine);
    write(part("hand-state"), this.#holder(open) || why);
    write(part("take"), this.#takeText());
    button("take").disabled = !steers;
    part("take").classList.toggle("primary", !mine);
    this.#refused = asking.find((page) => page === this.#refused);
    part("asked").hidden = !mine || asking.length === 0 || asking[0] === this.#refused;
    for (const one of orderButtons()) {
      const stop = one.dataset.order === "STOP";
      one.disabled = stop ? scene?.can_steer === false : !steers || !(mine || holder === null);
      one.setAttribute("aria-current", String(mine && one.dataset.order === this.#model.wish));
    }
  }

  /** Shows what changes with every snapshot: the state of the swarm, and what to do next.
   * @param {boolean} open */
  showSwarm(open) {
    const { word, tone } = open ? swarmState(this.#model) : { word: "no connection", tone: "danger" };
    write(part("swarm-state"), word);
    part("swarm-state").dataset.tone = tone;
    write(part("fly"), airborne(this.#model) ? "Fly" : "Take off");
    write(part("coach"), this.#advice(open));
  }

  /** @param {boolean} open @returns {string} */
  #holder(open) {
    const { mine, holder, scene } = this.#model;
    if (!open || scene === null) {
      return "";
    }
    if (!scene.can_steer) {
      return "this console only watches";
    }
    return mine ? "you hold it" : holder === null ? "free" : `page ${holder} holds it`;
  }

  /** @returns {string} */
  #takeText() {
    const { mine, holder } = this.#model;
    if (mine) {
      return "Release the hand";
    }
    return this.#releases ? "Asked; withdraw" : holder === null ? "Take the hand" : "Ask for the hand";
  }

  /** @param {boolean} open @returns {string} */
  #advice(open) {
    const { mine, holder, scene, wish } = this.#model;
    if (!open) {
      return scene ? "Connection lost: the swarm holds" : "";
    }
    if (!scene?.can_steer) {
      return "";
    }
    if (!mine) {
      return holder !== null ? "" : airborne(this.#model) ? "Drag here to take the hand" : "Press Take off to fly";
    }
    return ADVICE[wish] ?? "";
  }
}

/** @param {Model} model @returns {boolean} whether any drone is in the air */
function airborne(model) {
  return (model.snapshot?.drones ?? []).some(flies);
}

/** @param {Model} model @returns {{word: string, tone: string}} the swarm in one phrase */
function swarmState({ scene, snapshot }) {
  const drones = snapshot?.drones ?? [];
  const all = scene?.drones.length ?? 0;
  const heard = drones.filter(({ age }) => age <= STALE_S).length;
  if (heard < all) {
    return { word: `${all - heard} of ${all} silent`, tone: drones.length ? "danger" : "care" };
  }
  /** @param {string} mode */
  const count = (mode) => drones.filter((drone) => drone.mode === mode).length;
  if (count("STOP")) {
    return { word: "stopped", tone: "danger" };
  }
  for (const [mode, word] of [["LAND", "landing"], ["TAKEOFF", "taking off"], ["HOLD", "holding"]]) {
    if (count(mode)) {
      return { word, tone: "care" };
    }
  }
  return count("FOLLOW") ? { word: `${count("FOLLOW")} following`, tone: "good" } : { word: "landed", tone: "" };
}

/** @returns {NodeListOf<HTMLButtonElement>} */
function orderButtons() {
  return document.querySelectorAll("[data-order]");
}

/** @param {string} id @returns {HTMLButtonElement} */
function button(id) {
  return /** @type {HTMLButtonElement} */ (part(id));
}
