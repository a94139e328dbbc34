/** The page: receive -> compute -> draw and send, once per frame. */

import { Connection } from "./connection.js";
import { part, write } from "./dom.js";
import { Awake } from "./hand/awake.js";
import { Drag } from "./hand/drag.js";
import { Gamepads } from "./hand/gamepad.js";
import { Keys } from "./hand/keys.js";
import { Steering, together } from "./hand/steering.js";
import { Tilt } from "./hand/tilt.js";
import { Model } from "./model.js";
import { ControlPanel } from "./panels/control.js";
import { GlovePanel, showNotices, toggle } from "./panels/glove.js";
import { showHealth, showReferee } from "./panels/health.js";
import { Plots } from "./panels/plots.js";
import { followTheme } from "./panels/theme.js";
import { describe } from "./panels/words.js";
import { Views } from "./view/views.js";

/** The console lets go of a hand that is not repeated for 0.6 s. */
const REPEAT_MS = 200;
const LONGEST_FRAME_S = 0.1;
const WORDS_MS = 1000;
const REFUSAL_MS = 3000;

const model = new Model();
const steering = new Steering();
const views = new Views(part("top"), part("side"));
const plots = new Plots(part("plots"));
const glove = new GlovePanel();
const calm = matchMedia("(prefers-reduced-motion: reduce)");
let bare = false;

const connection = new Connection({ message: receive, state: connectionChanged, refused });
const control = new ControlPanel(model, (message) => connection.send(message), stop);
const keys = new Keys({ take: () => control.reach(), stop: () => control.order("STOP") });
const gamepads = new Gamepads((wish) => control.order(wish));
const tilt = new Tilt();
const awake = new Awake();

/** @param {any} message from the console, see docs/console.md */
function receive(message) {
  switch (message.type) {
    case "scene":
      return enter(message);
    case "snapshot":
      return model.see(message);
    case "control":
      return controlChanged(message);
    case "pattern":
      return glove.hear(message, performance.now());
    case "notices":
      return showNotices(message.notices);
    case "health":
      showHealth(message.processes);
      return showReferee(message.referee);
    case "refused":
      return disobeyed(message.why);
  }
}

/** @param {import("./model.js").Scene} scene */
function enter(scene) {
  model.enter(scene);
  steering.limit(scene.hand);
  write(part("swarm"), scene.swarm);
  write(part("details"), `${scene.drones.length} drones, ${scene.law} law`);
  control.show(connection.open);
}

/** @param {{holder: number | null, asking: number[], wish: string}} message */
function controlChanged(message) {
  const had = model.mine;
  model.holder = message.holder;
  model.asking = message.asking;
  model.wish = message.wish;
  if (model.mine && !had) {
    steering.begin(model.hand, model.snapshot?.hand?.yaw ?? 0);
  } else if (!model.mine) {
    steering.end();
  }
  if (model.mine !== had) {
    awake.keep(model.mine);
  }
  control.show(connection.open);
}

/** Whoever loses the connection has lost the hand too. @param {boolean} open @param {string} why if it is not */
function connectionChanged(open, why) {
  if (!open) {
    controlChanged({ holder: null, asking: [], wish: model.wish });
  }
  control.show(open, why);
}

/** Whoever has just lost the hand need not hear that its last move came too late. @param {string} why */
function disobeyed(why) {
  if (model.mine) {
    write(part("hand-state"), why);
    setTimeout(() => control.show(connection.open), REFUSAL_MS);
  }
}

/** STOP counts from every page, also from one that has no connection: such a page is told here what has become of it. */
async function stop() {
  const why = await connection.stop();
  if (why || !connection.open) {
    showNotices([{ level: "alarm", text: why ? `STOP was not heard: ${why}` : "STOP: motors off" }]);
  }
}

/** There is a console, but it does not let this page in. */
function refused() {
  write(part("hand-state"), "refused: open the address that the console printed");
}

let lastFrame = performance.now();
let lastSent = { at: 0, text: "" };
let lastWords = 0;

/** One frame. @param {number} now ms */
function frame(now) {
  steer((now - lastFrame) / 1000);
  tell(now);
  draw(now);
  lastFrame = now;
  requestAnimationFrame(frame);
}

/** Moves the wanted hand by whatever is pushed. @param {number} seconds since the last frame */
function steer(seconds) {
  const push = together([keys.push(), gamepads.poll(), tilt.push()]);
  steering.advance(push, Math.min(seconds, LONGEST_FRAME_S));
}

/**
 * Sends the wanted hand when it has moved, and again and again while it rests; by a clock as well, as a browser that
 * is slow to show frames is no hand that has let go.
 * @param {number} now ms
 */
function tell(now) {
  const message = steering.message();
  const text = JSON.stringify(message);
  if (message && (text !== lastSent.text || now - lastSent.at > REPEAT_MS)) {
    connection.send(message);
    lastSent = { at: now, text };
  }
}

/** @param {number} now ms */
function draw(now) {
  views.draw(model, { bare, trails: !calm.matches, target: steering.point });
  glove.show(now);
  control.showSwarm(connection.open);
  plots.sample(model);
  if (now - lastWords > WORDS_MS) {
    lastWords = now;
    write(part("swarm-text"), describe(model, bare));
    write(part("gamepad"), gamepads.name ? `gamepad: ${gamepads.name}` : "no gamepad");
  }
}

new Drag(part("surface"), {
  camera: () => views.camera,
  hand: () => model.hand,
  wanted: () => steering.point ?? model.hand,
  take: () => control.reach(),
  goTo: (x, y) => steering.goTo(x, y),
  lift: (metres) => steering.lift(metres),
});
toggle(part("tactile"), () => {
  bare = !bare;
  document.body.dataset.tactile = bare ? "on" : "off";
  return bare;
});
followTheme(part("theme"), () => {
  views.repaint();
  plots.repaint();
});
part("tilt-note").textContent = Tilt.missing;
part("tilt").toggleAttribute("disabled", Tilt.missing !== "");
part("tilt").addEventListener("click", async () => {
  part("tilt-note").textContent = await tilt.toggle();
  part("tilt").setAttribute("aria-pressed", String(tilt.on));
});
document.addEventListener("visibilitychange", () => document.hidden && letGo());
window.addEventListener("pagehide", letGo);

/** A page that nobody sees is no hand. */
function letGo() {
  if (model.mine) {
    connection.send({ type: "release" });
    steering.end();
  }
}

connection.connect();
requestAnimationFrame(frame);
setInterval(() => tell(performance.now()), REPEAT_MS / 2);
