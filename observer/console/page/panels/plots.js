/** Live plots of the last seconds: how far drones are from their goals, how large the formation is, the hand. */

import { flies } from "../model.js";
import { make } from "../dom.js";
import { readPalette } from "../view/palette.js";

/** @typedef {import("../model.js").Model} Model */

const { uPlot } = /** @type {any} */ (globalThis);

const SPAN_S = 20;
const SAMPLE_S = 0.1;
const HEIGHT_PX = 70;
const AXIS = { size: 34, gap: 4, space: 24, font: "11px Inter, system-ui, sans-serif", ticks: { show: false } };

/** @type {{name: string, unit: string, least: number, digits: number, of: (model: Model) => number | null}[]} */
const PLOTS = [
  { name: "Farthest from its goal", unit: "m", least: 0.3, digits: 2, of: farthest },
  { name: "Formation area", unit: "%", least: 130, digits: 0, of: area },
  { name: "Hand speed", unit: "m/s", least: 0.5, digits: 2, of: speed },
];

/** The column of plots. */
export class Plots {
  /** @type {number[]} */
  #times = [];
  #rows;
  #parent;

  /** @param {HTMLElement} parent where the plots go; its width is theirs */
  constructor(parent) {
    this.#parent = parent;
    this.#rows = PLOTS.map((plot) => ({ plot, values: /** @type {(number | null)[]} */ ([]), ...frame(parent, plot) }));
    this.#rows.forEach((row) => (row.chart = chart(row.box, row.plot.least)));
    new ResizeObserver(() => this.#resize()).observe(parent);
  }

  /** Takes one sample if it is time for one. @param {Model} model */
  sample(model) {
    const now = model.snapshot?.t ?? 0;
    if (now < (this.#times.at(-1) ?? 0)) {
      this.#forget(this.#times.length);
    }
    if (model.snapshot === null || now < (this.#times.at(-1) ?? -Infinity) + SAMPLE_S) {
      return;
    }
    this.#times.push(now);
    this.#rows.forEach(({ plot, values }) => values.push(plot.of(model)));
    this.#forget(this.#times.findIndex((time) => time >= now - SPAN_S));
    this.#draw(now);
  }

  /** Draws anew with the colours of the page. */
  repaint() {
    for (const row of this.#rows) {
      row.chart.destroy();
      row.chart = chart(row.box, row.plot.least);
    }
    this.#resize();
  }

  /** @param {number} now */
  #draw(now) {
    const ages = this.#times.map((time) => time - now);
    for (const { plot, values, chart: lines, value } of this.#rows) {
      lines.setData([ages, values]);
      const last = values.at(-1) ?? null;
      value.textContent = last === null ? "" : `${last.toFixed(plot.digits)} ${plot.unit}`;
    }
  }

  /** @param {number} count how many of the oldest samples */
  #forget(count) {
    this.#times.splice(0, count);
    this.#rows.forEach(({ values }) => values.splice(0, count));
  }

  #resize() {
    const width = this.#parent.clientWidth;
    this.#rows.forEach(({ chart: lines }) => lines.setSize({ width, height: HEIGHT_PX }));
  }
}

/** @param {HTMLElement} parent @param {{name: string}} plot
 * @returns {{box: HTMLElement, value: HTMLElement, chart: any}} */
function frame(parent, { name }) {
  const box = make("div", "");
  const title = make("p", name);
  const value = make("b", "");
  title.className = "plot-name";
  title.append(value);
  box.append(title);
  parent.append(box);
  return { box, value, chart: null };
}

/** @param {number} least upper end of the scale at least
 * @returns {(chart: unknown, low: number | null, high: number | null) => [number, number]} */
function upTo(least) {
  return (_chart, _low, high) => [0, Math.max(least, high ?? 0)];
}

/** @param {HTMLElement} box @param {number} least upper end of the scale at least */
function chart(box, least) {
  const palette = readPalette();
  return new uPlot(
    {
      width: Math.max(box.clientWidth, 1),
      height: HEIGHT_PX,
      legend: { show: false },
      cursor: { show: false },
      padding: [10, 0, 7, 0],
      scales: { x: { time: false, range: [-SPAN_S, 0] }, y: { range: upTo(least) } },
      axes: [{ show: false }, { ...AXIS, stroke: palette.soft, grid: { stroke: palette.line, width: 1 } }],
      series: [{}, { stroke: palette.accent, width: 1.5, points: { show: false } }],
    },
    [[], []],
    box,
  );
}

/** @param {Model} model @returns {number | null} m */
function farthest(model) {
  const errors = (model.snapshot?.drones ?? [])
    .filter(flies)
    .map(({ position, goal }) => Math.hypot(...position.map((value, axis) => value - goal[axis])));
  return errors.length ? Math.max(...errors) : null;
}

/** @param {Model} model @returns {number | null} per cent of the default formation */
function area(model) {
  const formation = model.snapshot?.formation;
  return formation ? 100 * formation.area_ratio : null;
}

/** @param {Model} model @returns {number | null} m/s */
function speed(model) {
  const velocity = model.snapshot?.hand?.velocity;
  return velocity ? Math.hypot(...velocity) : null;
}
