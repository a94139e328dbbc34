/** A canvas as large as its box, at the resolution of the screen (2 at most: more only costs time). */

const MOST_PIXELS_PER_PX = 2;

/**
 * Fits a canvas to its box and clears it.
 * @param {HTMLCanvasElement} canvas
 * @returns {{pen: CanvasRenderingContext2D, width: number, height: number}} pen in CSS px
 */
export function fit(canvas) {
  const density = Math.min(devicePixelRatio || 1, MOST_PIXELS_PER_PX);
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  const columns = Math.round(width * density);
  const rows = Math.round(height * density);
  if (canvas.width !== columns || canvas.height !== rows) {
    canvas.width = columns;
    canvas.height = rows;
  }
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  pen.setTransform(density, 0, 0, density, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}
