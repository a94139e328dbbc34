/** What the page knows of the swarm: the scene, the newest snapshot, and where everybody has been. */

/** @typedef {import("./view/camera.js").Vector} Vector */
/**
 * @typedef {object} Scene see docs/console.md
 * @property {number} you
 * @property {string} swarm
 * @property {string} law
 * @property {boolean} can_steer
 * @property {{start: Vector, low: Vector, high: Vector, max_speed: number, fixed_height: boolean}} hand
 * @property {{min: Vector, max: Vector}} fence
 * @property {{name: string, x: number, y: number, radius: number, range: number, height: number}[]} obstacles
 * @property {{id: number, references: (string | number)[], rest: Vector}[]} drones
 * @property {{name: string, from: string | number, to: number, limit: number}[]} links
 */
/**
 * @typedef {object} Drone
 * @property {number} id
 * @property {Vector} position
 * @property {Vector} velocity
 * @property {Vector} goal
 * @property {Vector} setpoint
 * @property {string} mode
 * @property {string[]} flags
 * @property {number} battery
 * @property {number} age
 * @property {Record<string, Vector>} links
 */
/**
 * @typedef {object} Obstacle what moves among the drones
 * @property {number} id
 * @property {Vector} position
 * @property {Vector} velocity
 * @property {number} radius
 * @property {number} height
 * @property {number} age
 */
/**
 * @typedef {object} Snapshot
 * @property {number} t
 * @property {null | {point: Vector, real: Vector, velocity: Vector, yaw: number, wish: string, age: number}} hand
 * @property {Drone[]} drones
 * @property {Obstacle[]} obstacles
 * @property {null | {area_ratio: number, extent: number, trend: number, missing: number[]}} formation
 */

const TRAIL_S = 6;
const TRAIL_STEP_S = 0.1;
export const STALE_S = 0.5;
const AIRBORNE = new Set(["TAKEOFF", "FOLLOW", "HOLD", "LAND"]);

/** @param {Drone} drone @returns {boolean} */
export function flies(drone) {
  return AIRBORNE.has(drone.mode);
}

/** Where one body has been over the last seconds. */
export class Trail {
  /** @type {{t: number, at: Vector}[]} oldest first */
  points = [];

  /** @param {number} t s @param {Vector} at */
  add(t, at) {
    const last = this.points.at(-1);
    if (last && t < last.t) {
      this.points = [];
    } else if (last && t < last.t + TRAIL_STEP_S) {
      return;
    }
    this.points.push({ t, at });
    while (this.points[0].t < t - TRAIL_S) {
      this.points.shift();
    }
  }
}

/** Everything that the parts of the page draw from. */
export class Model {
  /** @type {Scene | null} */
  scene = null;
  /** @type {Snapshot | null} */
  snapshot = null;
  /** @type {Map<number, Trail>} */
  trails = new Map();
  /** @type {number | null} number of the page that holds the hand */
  holder = null;
  /** @type {number[]} */
  asking = [];
  /** What the console's hand says. */
  wish = "GROUND";

  /** @param {Scene} scene */
  enter(scene) {
    this.scene = scene;
    this.trails = new Map(scene.drones.map(({ id }) => [id, new Trail()]));
  }

  /** @param {Snapshot} snapshot */
  see(snapshot) {
    this.snapshot = snapshot;
    for (const drone of snapshot.drones) {
      if (flies(drone)) {
        this.trails.get(drone.id)?.add(snapshot.t, drone.position);
      }
    }
  }

  /** @returns {boolean} whether this page holds the hand */
  get mine() {
    return this.scene !== null && this.holder === this.scene.you;
  }

  /** @returns {Vector} the mapped hand, or where it would start */
  get hand() {
    return this.snapshot?.hand?.point ?? this.scene?.hand.start ?? [0, 0, 0];
  }
}
