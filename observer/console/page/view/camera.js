/** From the world (m, ENU) to the screen (CSS px) and back: the operator looks along -x, +y is right. */

/** @typedef {[number, number, number]} Vector position in the world, m */
/** @typedef {{min: Vector, max: Vector}} Box */
/** @typedef {{left: number, top: number, width: number, height: number}} Area */

const MARGIN = 18;
const LEGEND_PX = 20;
const SKY_PX = 20;
const FLOOR_PX = 8;
const LEAST_EXTENT = 0.5;

/** The swarm from above. */
export class TopCamera {
  /**
   * Fits a box into a view.
   * @param {Box} box what must be seen
   * @param {number} width of the view, px
   * @param {number} height of the view, px
   */
  constructor(box, width, height) {
    const across = Math.max(box.max[1] - box.min[1], LEAST_EXTENT);
    const along = Math.max(box.max[0] - box.min[0], LEAST_EXTENT);
    /** px per metre */
    this.scale = Math.max(1, Math.min((width - 2 * MARGIN) / across, (height - 2 * MARGIN - LEGEND_PX) / along));
    this.left = width / 2 - (this.scale * (box.max[1] + box.min[1])) / 2;
    this.top = (height + LEGEND_PX) / 2 - (this.scale * (box.max[0] + box.min[0])) / 2;
  }

  /** @param {readonly number[]} point @returns {[number, number]} */
  toScreen(point) {
    return [this.left + this.scale * point[1], this.top + this.scale * point[0]];
  }

  /** @param {number} x @param {number} y @returns {[number, number]} x and y in the world */
  toWorld(x, y) {
    return [(y - this.top) / this.scale, (x - this.left) / this.scale];
  }
}

/** The swarm from behind, right below the view from above: whatever is there is on the same vertical. */
export class SideCamera {
  /**
   * @param {Box} box what must be seen
   * @param {TopCamera} top camera whose horizontal axis is shared
   * @param {number} height of the view, px
   */
  constructor(box, top, height) {
    const range = Math.max(box.max[2] - Math.max(box.min[2], 0), LEAST_EXTENT);
    /** px per metre upwards */
    this.scale = (height - SKY_PX - FLOOR_PX) / range;
    this.left = top.left;
    this.across = top.scale;
    this.floor = height - FLOOR_PX;
  }

  /** @param {readonly number[]} point @returns {[number, number]} */
  toScreen(point) {
    return [this.left + this.across * point[1], this.floor - this.scale * Math.max(point[2], 0)];
  }
}
