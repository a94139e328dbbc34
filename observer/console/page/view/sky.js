/** What moves: drones with goals, set-points, links and trails, and the hand. */

import { flies, STALE_S } from "../model.js";

/** @typedef {import("../model.js").Model} Model */
/** @typedef {import("../model.js").Drone} Drone */
/** @typedef {Record<string, string>} Palette */
/** @typedef {{toScreen: (point: readonly number[]) => [number, number], scale: number}} Camera */
/** @typedef {{bare: boolean, trails: boolean, target: readonly number[] | null}} Choice
 *   bare: the hand only; target: where this page steers the hand to */

const FULL = 2 * Math.PI;
const BODY_M = 0.18;
const LEAST_PX_WITH_ROTORS = 9;
const HAND_M = 0.2;
const CORNERS = [[-1, -1], [1, -1], [-1, 1], [1, 1]];
const WIDEST_LINK_PX = 4;
const WARNING_FLAGS = new Set(["blocked", "fence", "low_battery", "critical_battery", "old_pose", "reference_lost"]);

/**
 * Draws the swarm from above.
 * @param {CanvasRenderingContext2D} pen
 * @param {Camera} camera
 * @param {Model} model
 * @param {Palette} palette
 * @param {Choice} choice
 */
export function drawSky(pen, camera, model, palette, choice) {
  const drones = model.snapshot?.drones ?? [];
  if (!choice.bare) {
    if (choice.trails) {
      drawTrails(pen, camera, model, palette);
    }
    drawWalkers(pen, camera, model, palette);
    drawLinks(pen, camera, model, palette);
    drawIntents(pen, camera, drones, palette);
    const radius = Math.min(17, Math.max(5, BODY_M * camera.scale));
    for (const drone of drones) {
      drawDrone(pen, camera.toScreen(drone.position), drone, radius, palette);
    }
  }
  drawHand(pen, camera, model, palette, choice);
}

/**
 * Draws the swarm from behind.
 * @param {CanvasRenderingContext2D} pen
 * @param {import("./camera.js").SideCamera} camera
 * @param {Model} model
 * @param {Palette} palette
 * @param {Choice} choice
 */
export function drawHeights(pen, camera, model, palette, choice) {
  pen.lineWidth = 1;
  if (!choice.bare) {
    for (const { position, radius, height } of model.snapshot?.obstacles ?? []) {
      const [x, foot] = camera.toScreen(position);
      const [, top] = camera.toScreen([position[0], position[1], position[2] + height]);
      pen.fillStyle = palette.care;
      pen.globalAlpha = 0.35;
      pen.fillRect(x - radius * camera.across, top, 2 * radius * camera.across, foot - top);
      pen.globalAlpha = 1;
    }
    for (const drone of model.snapshot?.drones ?? []) {
      const [x, y] = camera.toScreen(drone.position);
      const [, goal] = camera.toScreen([drone.position[0], drone.position[1], drone.goal[2]]);
      pen.strokeStyle = pen.fillStyle = tone(drone, palette);
      pen.globalAlpha = 0.35;
      stroke(pen, x, camera.floor, x, y);
      pen.globalAlpha = 1;
      if (flies(drone)) {
        stroke(pen, x - 7, goal, x + 7, goal);
      }
      disc(pen, x, y, 4.5);
    }
  }
  const [x, y] = camera.toScreen(model.hand);
  pen.strokeStyle = palette.ink;
  pen.lineWidth = 1.5;
  ring(pen, x, y, 6);
}

/** @param {CanvasRenderingContext2D} pen @param {Camera} camera @param {Model} model @param {Palette} palette */
function drawTrails(pen, camera, model, palette) {
  pen.strokeStyle = palette.accent;
  pen.lineWidth = 1.5;
  pen.lineJoin = "round";
  pen.globalAlpha = 0.3;
  pen.beginPath();
  for (const { points } of model.trails.values()) {
    points.forEach(({ at }, index) => {
      const [x, y] = camera.toScreen(at);
      if (index === 0) {
        pen.moveTo(x, y);
      } else {
        pen.lineTo(x, y);
      }
    });
  }
  pen.stroke();
  pen.globalAlpha = 1;
}

/** Who walks among the drones is a disc, with a line to where it will be in half a second.
 * @param {CanvasRenderingContext2D} pen @param {Camera} camera @param {Model} model @param {Palette} palette */
function drawWalkers(pen, camera, model, palette) {
  pen.strokeStyle = pen.fillStyle = palette.care;
  pen.lineWidth = 1.5;
  for (const { position, velocity, radius } of model.snapshot?.obstacles ?? []) {
    const [x, y] = camera.toScreen(position);
    pen.globalAlpha = 0.35;
    disc(pen, x, y, radius * camera.scale);
    pen.globalAlpha = 1;
    ring(pen, x, y, radius * camera.scale);
    const soon = [position[0] + 0.5 * velocity[0], position[1] + 0.5 * velocity[1], 0];
    stroke(pen, x, y, ...camera.toScreen(soon));
  }
}

/** A link is a line, the thicker the further its spring is displaced.
 * @param {CanvasRenderingContext2D} pen @param {Camera} camera @param {Model} model @param {Palette} palette */
function drawLinks(pen, camera, model, palette) {
  const drones = new Map((model.snapshot?.drones ?? []).map((drone) => [drone.id, drone]));
  pen.strokeStyle = palette.soft;
  pen.globalAlpha = 0.7;
  for (const { name, from, to, limit } of model.scene?.links ?? []) {
    const end = drones.get(to);
    const start = from === "human" ? model.hand : drones.get(Number(from))?.position;
    if (end && start) {
      const strain = Math.min(1, Math.hypot(...(end.links[name] ?? [0])) / limit);
      pen.lineWidth = 1 + strain * (WIDEST_LINK_PX - 1);
      stroke(pen, ...camera.toScreen(start), ...camera.toScreen(end.position));
    }
  }
  pen.globalAlpha = 1;
}

/** Goals are rings, set-points are crosses.
 * @param {CanvasRenderingContext2D} pen @param {Camera} camera @param {Drone[]} drones @param {Palette} palette */
function drawIntents(pen, camera, drones, palette) {
  pen.lineWidth = 1.5;
  for (const drone of drones.filter(flies)) {
    const [x, y] = camera.toScreen(drone.goal);
    pen.strokeStyle = palette.ink;
    ring(pen, x, y, 4);
    const [left, top] = camera.toScreen(drone.setpoint);
    stroke(pen, left - 4, top, left + 4, top);
    stroke(pen, left, top - 4, left, top + 4);
  }
}

/** Four rotors and the number in the middle.
 * @param {CanvasRenderingContext2D} pen @param {[number, number]} place @param {Drone} drone
 * @param {number} radius @param {Palette} palette */
function drawDrone(pen, [x, y], drone, radius, palette) {
  pen.fillStyle = tone(drone, palette);
  if (radius < LEAST_PX_WITH_ROTORS) {
    disc(pen, x, y, radius);
  } else {
    pen.globalAlpha = 0.45;
    for (const [sideways, ahead] of CORNERS) {
      disc(pen, x + sideways * radius * 0.7, y + ahead * radius * 0.7, radius * 0.46);
    }
    pen.globalAlpha = 1;
    disc(pen, x, y, radius * 0.72);
    pen.fillStyle = palette.field;
    pen.font = `600 ${Math.round(radius)}px Inter, system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText(String(drone.id), x, y + 0.5);
  }
  if (flies(drone) && drone.flags.some((flag) => WARNING_FLAGS.has(flag))) {
    pen.strokeStyle = palette.care;
    pen.lineWidth = 2;
    ring(pen, x, y, radius * 1.5);
  }
}

/** @param {Drone} drone @param {Palette} palette @returns {string} */
function tone(drone, palette) {
  if (drone.age > STALE_S || drone.mode === "STOP") {
    return palette.danger_ink;
  }
  return flies(drone) ? palette.accent : palette.soft;
}

/** @param {CanvasRenderingContext2D} pen @param {Camera} camera @param {Model} model @param {Palette} palette
 * @param {Choice} choice */
function drawHand(pen, camera, model, palette, { target }) {
  const [x, y] = camera.toScreen(model.hand);
  if (target) {
    const [left, top] = camera.toScreen(target);
    pen.strokeStyle = palette.soft;
    pen.lineWidth = 1;
    pen.setLineDash([3, 4]);
    stroke(pen, x, y, left, top);
    pen.setLineDash([]);
    ring(pen, left, top, 4);
  }
  pen.strokeStyle = pen.fillStyle = palette.ink;
  pen.lineWidth = model.mine ? 3 : 1.5;
  ring(pen, x, y, Math.min(14, Math.max(9, HAND_M * camera.scale)));
  disc(pen, x, y, 2.5);
}

/** @param {CanvasRenderingContext2D} pen @param {number} x @param {number} y @param {number} radius */
function ring(pen, x, y, radius) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, FULL);
  pen.stroke();
}

/** @param {CanvasRenderingContext2D} pen @param {number} x @param {number} y @param {number} radius */
function disc(pen, x, y, radius) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, FULL);
  pen.fill();
}

/** @param {CanvasRenderingContext2D} pen @param {number} x1 @param {number} y1 @param {number} x2
 * @param {number} y2 */
function stroke(pen, x1, y1, x2, y2) {
  pen.beginPath();
  pen.moveTo(x1, y1);
  pen.lineTo(x2, y2);
  pen.stroke();
}
