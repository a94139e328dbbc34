/** The table of processes, and one word about all of them. */

import { make, part, write } from "../dom.js";

const SILENT_S = 3;

/** @typedef {{name: string, present: boolean, state: string, rate_hz: number, cpu: number, rss_mb: number,
 *   age: number | null}} Process */

/**
 * Shows the processes, the ailing ones first.
 * @param {Process[]} processes
 */
export function showHealth(processes) {
  const ailing = processes.filter((process) => condition(process).tone !== "");
  const others = processes.filter((process) => condition(process).tone === "");
  part("processes").replaceChildren(...[...ailing, ...others].map(row));
  const all = processes.length;
  write(part("health-sum"), ailing.length ? `${all - ailing.length} of ${all} well` : `all ${all} well`);
}

/**
 * Shows what the simulated world has seen, whatever the drones believe; nothing where the world is real.
 * @param {Record<string, number>} referee
 */
export function showReferee({ collisions, min_distance_m }) {
  const apart = min_distance_m === undefined ? "" : `, at least ${min_distance_m.toFixed(2)} m apart`;
  const hits = collisions === 1 ? "1 collision" : `${collisions} collisions`;
  write(part("referee"), collisions === undefined ? "" : `${hits}${apart}`);
  part("referee").dataset.tone = collisions > 0 ? "danger" : "";
}

/** @param {Process} process @returns {HTMLElement} */
function row(process) {
  const { word, tone } = condition(process);
  const line = document.createElement("tr");
  line.append(
    make("td", process.name),
    make("td", word, tone),
    make("td", process.rate_hz.toFixed(0)),
    make("td", `${(100 * process.cpu).toFixed(0)} %`),
    make("td", process.rss_mb.toFixed(0)),
  );
  return line;
}

/** @param {Process} process @returns {{word: string, tone: string}} */
function condition(process) {
  if (!process.present) {
    return { word: "gone", tone: "danger" };
  }
  if ((process.age ?? 0) > SILENT_S) {
    return { word: "silent", tone: "danger" };
  }
  return { word: process.state, tone: process.state === "degraded" ? "care" : "" };
}
