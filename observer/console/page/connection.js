/** The WebSocket to the console; comes back by itself. */

const FIRST_RETRY_MS = 250;
const LAST_RETRY_MS = 3000;

/** @typedef {{message: (message: any) => void, state: (open: boolean, why: string) => void, refused: () => void}} Ear */

/** One connection at a time; whatever is sent while there is none is lost, as it would be stale. */
export class Connection {
  /** @type {WebSocket | null} */
  #socket = null;
  #retry_ms = FIRST_RETRY_MS;
  /** @type {Ear} */
  #ear;

  /** @param {Ear} ear who is told what happens */
  constructor(ear) {
    this.#ear = ear;
  }

  /** @returns {boolean} */
  get open() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  /** Connects, and from then on again whenever the connection is lost. */
  connect() {
    const socket = new WebSocket(new URL("ws", location.href.replace(/^http/, "ws")));
    let opened = false;
    this.#socket = socket;
    socket.onopen = () => {
      opened = true;
      this.#ear.state(true, "");
    };
    socket.onmessage = (event) => {
      this.#retry_ms = FIRST_RETRY_MS; // whoever is turned away at once need not hurry back
      this.#ear.message(JSON.parse(event.data));
    };
    socket.onclose = ({ reason }) => this.#lost(opened, reason);
  }

  /** @param {object} message */
  send(message) {
    if (this.open) {
      this.#socket?.send(JSON.stringify(message));
    }
  }

  /** Stops all motors by every way there is: a page for which there was no place, or whose connection hangs, can.
   * @returns {Promise<string>} why it was not heard, empty if it was */
  async stop() {
    this.send({ type: "wish", wish: "STOP" });
    return fetch("stop", { method: "POST" }).then(
      async (answer) => (answer.ok ? "" : await answer.text()),
      () => "the console does not answer",
    );
  }

  /** A refused WebSocket does not say why; a plain request does: a console that was started again may have a new
   * token. @returns {Promise<boolean>} */
  async #refused() {
    return fetch("./").then(({ status }) => status === 403, () => false);
  }

  /** @param {boolean} opened whether it had ever been open @param {string} reason what the console says of it */
  async #lost(opened, reason) {
    this.#ear.state(false, reason);
    if (!opened && (await this.#refused())) {
      this.#ear.refused();
      return;
    }
    setTimeout(() => this.connect(), this.#retry_ms);
    this.#retry_ms = Math.min(2 * this.#retry_ms, LAST_RETRY_MS);
  }
}
