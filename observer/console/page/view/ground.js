/** What does not move: a grid of metres, the fence and the obstacles. Drawn again only when the view changes. */

/** @typedef {import("../model.js").Scene} Scene */
/** @typedef {Record<string, string>} Palette */

const DASH = [6, 6];

/**
 * Draws the ground from above.
 * @param {CanvasRenderingContext2D} pen
 * @param {import("./camera.js").TopCamera} camera
 * @param {Scene} scene
 * @param {Palette} palette
 * @param {{width: number, height: number, bare: boolean}} view bare: without obstacles
 */
export function drawGround(pen, camera, scene, palette, view) {
  drawGrid(pen, camera, palette, view);
  const [left, top] = camera.toScreen(scene.fence.min);
  const [right, bottom] = camera.toScreen(scene.fence.max);
  pen.strokeStyle = palette.soft;
  pen.lineWidth = 1;
  pen.setLineDash(DASH);
  pen.strokeRect(left, top, right - left, bottom - top);
  pen.setLineDash([]);
  if (!view.bare) {
    drawColumns(pen, camera, scene, palette);
  }
}

/**
 * Draws the ground from behind: floor, ceiling of the fence, columns.
 * @param {CanvasRenderingContext2D} pen
 * @param {import("./camera.js").SideCamera} camera
 * @param {Scene} scene
 * @param {Palette} palette
 * @param {{width: number, height: number, bare: boolean}} view
 */
export function drawWall(pen, camera, scene, palette, view) {
  if (!view.bare) {
    pen.fillStyle = palette.obstacle;
    pen.globalAlpha = 0.22;
    for (const { y, radius, height } of scene.obstacles) {
      const [x, top] = camera.toScreen([0, y, height]);
      pen.fillRect(x - radius * camera.across, top, 2 * radius * camera.across, camera.floor - top);
    }
    pen.globalAlpha = 1;
  }
  pen.font = "11px Inter, system-ui, sans-serif";
  pen.textBaseline = "bottom";
  pen.lineWidth = 1;
  for (let height = 0; height <= scene.fence.max[2]; height += 1) {
    const [, y] = camera.toScreen([0, 0, height]);
    line(pen, height === 0 ? palette.line : palette.grid, 0, y, view.width, y);
    pen.fillStyle = palette.soft;
    pen.fillText(`${height} m`, view.width - 28, y - 1);
  }
}

/** @param {CanvasRenderingContext2D} pen @param {import("./camera.js").TopCamera} camera @param {Palette} palette
 * @param {{width: number, height: number}} view */
function drawGrid(pen, camera, palette, { width, height }) {
  const [firstX, firstY] = camera.toWorld(0, 0);
  const [lastX, lastY] = camera.toWorld(width, height);
  pen.lineWidth = 1;
  for (let x = Math.ceil(firstX); x <= lastX; x += 1) {
    const [, y] = camera.toScreen([x, 0]);
    line(pen, palette.grid, 0, y, width, y);
  }
  for (let y = Math.ceil(firstY); y <= lastY; y += 1) {
    const [x] = camera.toScreen([0, y]);
    line(pen, palette.grid, x, 0, x, height);
  }
}

/** @param {CanvasRenderingContext2D} pen @param {import("./camera.js").TopCamera} camera @param {Scene} scene
 * @param {Palette} palette */
function drawColumns(pen, camera, scene, palette) {
  pen.fillStyle = palette.obstacle;
  for (const { x, y, radius, range } of scene.obstacles) {
    const [left, top] = camera.toScreen([x, y]);
    for (const [reach, opacity] of [[range, 0.16], [radius, 1]]) {
      pen.globalAlpha = opacity;
      pen.beginPath();
      pen.arc(left, top, reach * camera.scale, 0, 2 * Math.PI);
      pen.fill();
    }
  }
  pen.globalAlpha = 1;
}

/** @param {CanvasRenderingContext2D} pen @param {string} colour @param {number} x1 @param {number} y1
 * @param {number} x2 @param {number} y2 */
function line(pen, colour, x1, y1, x2, y2) {
  pen.strokeStyle = colour;
  pen.beginPath();
  pen.moveTo(Math.round(x1) + 0.5, Math.round(y1) + 0.5);
  pen.lineTo(Math.round(x2) + 0.5, Math.round(y2) + 0.5);
  pen.stroke();
}
