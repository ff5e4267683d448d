/** Talks to the server: the token, requests, and sockets that are opened again when they are lost. */

const PREFIX = "/api/v1";
const KEPT = "throwcollect.token";
const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 10_000;
const TRIES = 3;

/** A problem that the server reports, or that the server cannot be reached (status 0). */
export class Problem extends Error {
  /**
   * @param {number} status
   * @param {{title?: string, hint?: string, expected?: string, problems?: {key?: string, message: string}[]}} facts
   */
  constructor(status, facts) {
    super(facts.title ?? `the server answered ${status}`);
    this.status = status;
    this.facts = facts;
  }
}

/**
 * Get the token: by the code in the address, which is then removed from the address, or the one that this tab keeps.
 * @returns {Promise<string | null>} null if there is none
 * @throws {Problem} if the code is used or too old and no token is kept
 */
export async function takeToken() {
  const kept = sessionStorage.getItem(KEPT);
  const code = new URLSearchParams(location.hash.slice(1)).get("code");
  if (code === null) return kept;
  history.replaceState(null, "", location.pathname + location.search);
  try {
    const { token } = await new Connection(null).read("POST", "/exchange", { code });
    keepToken(token);
    return token;
  } catch (error) {
    if (kept === null) throw error;
    return kept;
  }
}

/** @param {string | null} token that this tab keeps; null to forget it */
export function keepToken(token) {
  if (token === null) sessionStorage.removeItem(KEPT);
  else sessionStorage.setItem(KEPT, token);
}

/** Try a request again: browsers break requests off when any network of the machine changes. */
async function attempt(act, tries) {
  try {
    return await act();
  } catch {
    if (tries === 1) throw new Problem(0, { title: "the server cannot be reached" });
    await new Promise((resolve) => setTimeout(resolve, FIRST_WAIT_MS));
    return attempt(act, tries - 1);
  }
}

/** Requests and sockets. */
export class Connection {
  /** @param {string | null} token null if the user has none yet */
  constructor(token) {
    this.token = token;
  }

  /**
   * Ask the server.
   * @param {string} method
   * @param {string} path below the interface
   * @param {unknown} [body] is sent as JSON
   * @returns {Promise<Response>}
   * @throws {Problem}
   */
  async ask(method, path, body) {
    const headers = this.token === null ? {} : { Authorization: `Bearer ${this.token}` };
    if (body !== undefined) headers["Content-Type"] = "application/json";
    const request = { method, headers, body: body === undefined ? null : JSON.stringify(body) };
    // Only a request that changes nothing may be sent again.
    const response = await attempt(() => fetch(PREFIX + path, request), method === "GET" ? TRIES : 1);
    if (!response.ok) throw new Problem(response.status, await response.json().catch(() => ({})));
    return response;
  }

  /** Ask the server as `ask` does, and return the values of the JSON in the answer. */
  async read(method, path, body) {
    return (await this.ask(method, path, body)).json();
  }

  /**
   * Open a socket, and open it again whenever it is lost, after a wait that grows.
   * @param {string} path below the interface
   * @param {SocketEvents} events
   * @returns {Socket}
   */
  open(path, events) {
    return new Socket(this.token, PREFIX + path, events);
  }

  /**
   * Open a socket of rosbridge, which lies beside the interface.
   * @param {string} run id of the run
   * @param {SocketEvents} events
   * @returns {Socket}
   */
  openRosbridge(run, events) {
    return new Socket(this.token, `/rosbridge/${encodeURIComponent(run)}`, events);
  }
}

/**
 * @typedef {object} SocketEvents
 * @property {(data: any) => void} receive a message: text, or an ArrayBuffer
 * @property {() => void} [opened] called each time that the socket is open
 * @property {(waitMs: number) => void} [lost] called when it was lost; it is opened again after this time
 */

/** A socket that is opened again when it is lost. */
export class Socket {
  #socket = null;
  #timer = 0;
  #wait = FIRST_WAIT_MS;
  #closed = false;

  /**
   * @param {string} token
   * @param {string} path
   * @param {SocketEvents} events
   */
  constructor(token, path, events) {
    this.token = token;
    this.url = `${location.origin.replace(/^http/, "ws")}${path}`;
    this.events = events;
    this.#connect();
  }

  /** @param {string} text to send; it is dropped if the socket is not open */
  send(text) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(text);
  }

  /** Open the socket at once, if it is lost. */
  hurry() {
    if (this.#timer) this.#connect();
  }

  close() {
    this.#closed = true;
    clearTimeout(this.#timer);
    this.#socket?.close();
  }

  #connect() {
    clearTimeout(this.#timer);
    this.#timer = 0;
    const socket = new WebSocket(this.url, [`bearer.${this.token}`]);
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    socket.onopen = () => {
      this.#wait = FIRST_WAIT_MS;
      this.events.opened?.();
    };
    socket.onmessage = ({ data }) => {
      if (!this.#closed) this.events.receive(data);
    };
    socket.onclose = () => {
      if (this.#closed) return;
      // The wait is random, so that pages do not all connect at the same instant when a server is back.
      const wait = this.#wait * (0.75 + Math.random() / 2);
      this.#wait = Math.min(this.#wait * 2, LONGEST_WAIT_MS);
      this.#timer = setTimeout(() => this.#connect(), wait);
      this.events.lost?.(wait);
    };
  }
}
