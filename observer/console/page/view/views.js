/** The two views: from above and from behind, each with a layer that rests and one that moves. */

import { SideCamera, TopCamera } from "./camera.js";
import { fit } from "./canvas.js";
import { drawGround, drawWall } from "./ground.js";
import { readPalette } from "./palette.js";
import { drawHeights, drawSky } from "./sky.js";

/** Draws the model; asks for nothing but a call per frame. */
export class Views {
  #top;
  #side;
  #palette = readPalette();
  /** @type {TopCamera | null} */
  #camera = null;
  /** @type {unknown[]} what the resting layer was drawn from */
  #resting = [];

  /** @param {Element} top @param {Element} side */
  constructor(top, side) {
    this.#top = [...top.querySelectorAll("canvas")];
    this.#side = [...side.querySelectorAll("canvas")];
  }

  /** @returns {TopCamera | null} camera of the view from above; null before the first scene */
  get camera() {
    return this.#camera;
  }

  /** Reads the colours again and draws what rests anew. */
  repaint() {
    this.#palette = readPalette();
    this.#resting = [];
  }

  /**
   * Draws one frame.
   * @param {import("../model.js").Model} model
   * @param {import("./sky.js").Choice} choice
   */
  draw(model, choice) {
    const scene = model.scene;
    if (scene === null) {
      return;
    }
    const sky = fit(this.#top[1]);
    const heights = fit(this.#side[1]);
    const camera = new TopCamera(scene.fence, sky.width, sky.height);
    const side = new SideCamera(scene.fence, camera, heights.height);
    this.#camera = camera;
    this.#drawRest(scene, camera, side, choice.bare);
    drawSky(sky.pen, camera, model, this.#palette, choice);
    drawHeights(heights.pen, side, model, this.#palette, choice);
  }

  /**
   * @param {import("../model.js").Scene} scene
   * @param {TopCamera} camera
   * @param {SideCamera} side
   * @param {boolean} bare
   */
  #drawRest(scene, camera, side, bare) {
    const resting = [scene, camera.scale, camera.left, camera.top, side.floor, devicePixelRatio, bare];
    if (resting.every((value, index) => value === this.#resting[index])) {
      return;
    }
    this.#resting = resting;
    const ground = fit(this.#top[0]);
    const wall = fit(this.#side[0]);
    drawGround(ground.pen, camera, scene, this.#palette, { ...ground, bare });
    drawWall(wall.pen, side, scene, this.#palette, { ...wall, bare });
  }
}
