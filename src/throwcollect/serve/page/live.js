/** Simulations as they move at the moment, and descriptions of robots, which may change at any time; both by rosbridge. */

import { get, setText } from "./dom.js";
import { Rosbridge } from "./rosbridge.js";
import { lives } from "./state.js";

/** Messages that plots remember of a simulation: 30 a second. */
const KEPT = 600;

/**
 * @typedef {object} Moment
 * @property {number} time since the page was opened [s]
 * @property {Record<string, number>} position of joints [rad]
 * @property {Record<string, number>} velocity [rad/s]
 * @property {Record<string, number>} effort [Nm]
 * @property {number[] | null} ball [m]
 */

/**
 * @param {string} simulation
 * @param {string} body
 * @returns {string} topic of its odometry
 */
function topicOf(simulation, body) {
  return body === "ball" ? `/${simulation}/ball/odometry` : `/${simulation}/bodies/${body}/odometry`;
}

/** Follows the simulations that are shown. */
export class Live {
  /** @type {Set<string>} names of the simulations that are shown as they move */
  simulations = new Set();
  /** @type {Map<string, Moment[]>} */
  #moments = new Map();
  /** @type {Map<string, number[]>} centres of the objects */
  #objects = new Map();
  /** @type {Map<string, string[]>} bodies that are followed, by simulation, with the object last */
  #bodies = new Map();
  /** Counts connections; subscriptions end with theirs. */
  connections = 0;
  #bridge = null;
  #run = null;
  #described = new Set();
  /** Sockets that hold simulations at real time for as long as they are open. */
  #holds = new Map();
  #wanted = false;
  /** @type {(text: string) => void} called with the reason why something was not published */
  refused = () => {};
  #instance = null;
  #alone = "";
  /** Simulations of the run whose recording this page has begun. */
  #recorded = new Set();

  /**
   * @param {object} parts
   * @param {import("./connection.js").Connection} parts.connection
   * @param {import("./scene.js").View} parts.view
   * @param {import("./watching.js").Watching} parts.watching
   * @param {(text: string) => void} parts.tell says what is wrong
   * @param {() => void} parts.choose shows one simulation alone
   */
  constructor({ connection, view, watching, tell, choose }) {
    Object.assign(this, { connection, view, watching, tell, choose });
    watching.known = () => this.#follow();
    get("live").addEventListener("click", () => {
      // Only one simulation at a time is slowed down to real time.
      if (!this.#alone) this.choose();
      this.#wanted = !this.#wanted;
      this.tell("");
      this.#follow();
    });
    get("record").addEventListener("click", () => this.#record());
    document.addEventListener("visibilitychange", () => this.#follow());
  }

  /**
   * @param {import("./state.js").Instance | undefined} instance that is watched
   * @param {string} alone name of the simulation that is shown alone; empty if all are
   */
  put(instance, alone) {
    if (alone !== this.#alone || instance?.id !== this.#instance?.id) this.#wanted = false;
    this.#instance = instance;
    this.#alone = alone;
    this.#follow();
  }

  /**
   * @param {string} simulation
   * @returns {Moment[]} its last moments, the newest last
   */
  momentsOf(simulation) {
    return this.#moments.get(simulation) ?? [];
  }

  /**
   * Publish a message in the run that is watched.
   * @param {string} topic
   * @param {string} type
   * @param {object} message
   * @throws {Error} if the run does not live, or there is no connection
   */
  publish(topic, type, message) {
    if (this.#bridge === null) throw new Error("no simulation runs that could hear it");
    this.#bridge.publish(topic, type, message);
  }

  /** Subscribe to a topic of the run that is watched, as `Rosbridge` does. */
  subscribe(topic, type, hear, period) {
    this.#bridge?.subscribe(topic, type, hear, period);
  }

  /** @param {string} topic to unsubscribe from */
  unsubscribe(topic) {
    this.#bridge?.unsubscribe(topic);
  }

  /** Call a service of the run that is watched, as `Rosbridge` does. */
  async call(service, type, args) {
    if (this.#bridge === null) throw new Error("no simulation runs that could answer");
    return this.#bridge.call(service, type, args);
  }

  #follow() {
    const instance = this.#instance;
    const isKnown = Boolean(instance) && instance.robots.length > 0 && this.watching.moving.length > 0;
    const isSeen = isKnown && lives(instance) && !document.hidden;
    const run = isSeen ? instance.id : null;
    if (run !== this.#run) this.#connect(run);
    this.#showButton(instance, isSeen);
    this.#showRecord(instance, isSeen);
    const isSession = instance?.kind === "session";
    const wanted = !isSeen ? [] : isSession ? this.view.shown : this.#wanted && this.#alone ? [this.#alone] : [];
    for (const name of [...this.simulations]) if (!wanted.includes(name)) this.#leave(name);
    for (const name of wanted) if (!this.simulations.has(name)) this.#join(name, !isSession);
    if (isSeen) for (const name of this.view.shown) if (instance.robots.includes(name)) this.#describe(name);
  }

  #showButton(instance, isSeen) {
    const button = get("live");
    const isPressed = this.#wanted || instance?.kind === "session";
    button.hidden = !isSeen || instance.kind === "session";
    button.title = isPressed ? "" : "slow one simulation down to real time, and see it as it moves";
    button.setAttribute("aria-pressed", String(isPressed));
    setText(button, isPressed ? "Live: back to replays" : "Live");
  }

  /** @returns {string} the simulation of a session that the button records: the one that is shown, if it is one */
  get #recordable() {
    if (this.#run === null || this.#instance?.kind !== "session") return "";
    return this.#alone || (this.#instance.robots.length === 1 ? this.#instance.robots[0] : "");
  }

  #showRecord(instance, isSeen) {
    const button = get("record");
    const isRecorded = this.#recorded.has(this.#recordable);
    button.hidden = !isSeen || instance.kind !== "session";
    button.setAttribute("aria-disabled", String(!this.#recordable));
    button.title = this.#recordable ? "record what clients do as episodes of a dataset" : "choose one simulation first: each records its own episodes";
    button.setAttribute("aria-pressed", String(isRecorded));
    setText(button, isRecorded ? "Stop recording" : "Record");
  }

  /** Begin or end the recording of what clients do with a simulation. */
  async #record() {
    const name = this.#recordable;
    if (!name) {
      this.tell("choose one simulation first: each records its own episodes");
      return;
    }
    const begins = !this.#recorded.has(name);
    try {
      const { message } = await this.#bridge.call(`/${name}/record`, "std_srvs/srv/SetBool", { data: begins });
      // What is recorded already, by this page before it was loaded anew or by another client, can be ended here.
      if (begins) this.#recorded.add(name);
      else this.#recorded.delete(name);
      this.tell(`${name}: ${message}`);
    } catch ({ message }) {
      this.tell(`${name} is not recorded: ${message}`);
    }
    this.#showRecord(this.#instance, true);
  }

  #connect(run) {
    this.#recorded.clear();
    for (const name of [...this.simulations]) this.#leave(name);
    this.#bridge?.close();
    this.#bridge = null;
    this.connections += 1;
    this.#described.clear();
    this.#run = run;
    if (run !== null) {
      this.#bridge = new Rosbridge(this.connection, run, {
        lost: () => this.simulations.size && this.tell("live: the connection to the run is lost; trying again"),
        opened: () => this.simulations.size && this.tell(""),
        refused: (text) => this.refused(text),
      });
    }
  }

  #describe(name) {
    if (this.#described.has(name)) return;
    this.#described.add(name);
    this.#bridge.subscribe(`/${name}/robot_description`, "std_msgs/msg/String", ({ data }) => this.watching.describe(name, data));
  }

  #join(name, slowly) {
    this.simulations.add(name);
    this.#moments.set(name, []);
    this.#bridge.subscribe(`/${name}/joint_states`, "sensor_msgs/msg/JointState", (message) => this.#move(name, message));
    const moving = this.watching.moving;
    this.#bodies.set(name, moving);
    for (const body of moving) {
      this.#bridge.subscribe(topicOf(name, body), "nav_msgs/msg/Odometry", ({ pose }) => {
        const { position: { x, y, z }, orientation: turn } = pose.pose;
        if (body === moving.at(-1)) this.#objects.set(name, [x, y, z]);
        this.view.stations.get(name)?.bodies.place(body, [x, y, z, turn.x, turn.y, turn.z, turn.w]);
        this.view.touch();
      });
    }
    if (slowly) this.#slowDown(name);
  }

  #leave(name) {
    this.simulations.delete(name);
    this.#moments.delete(name);
    this.#objects.delete(name);
    const topics = [`/${name}/joint_states`, ...(this.#bodies.get(name) ?? []).map((body) => topicOf(name, body))];
    for (const topic of topics) this.#bridge?.unsubscribe(topic);
    this.#bodies.delete(name);
    this.#holds.get(name)?.close();
    this.#holds.delete(name);
  }

  #move(name, { name: joints, position, velocity, effort }) {
    const station = this.view.stations.get(name);
    const pairs = (values) => joints.map((joint, i) => [joint, values[i]]);
    station?.robot?.move(pairs(position));
    this.view.touch();
    const moments = this.#moments.get(name);
    if (!moments) return;
    const [positions, velocities, efforts] = [position, velocity, effort].map((values) => Object.fromEntries(pairs(values)));
    moments.push({
      time: performance.now() / 1000, position: positions, velocity: velocities, effort: efforts, ball: this.#objects.get(name) ?? null,
    });
    if (moments.length > KEPT) moments.shift();
  }

  /** Slow a simulation down, because at full speed nothing could be seen; the server ends that after the last page. */
  #slowDown(name) {
    const path = `/instances/${encodeURIComponent(this.#run)}/live/${encodeURIComponent(name)}`;
    this.#holds.set(name, this.connection.open(path, {
      receive: () => {},
      opened: () => this.tell(`${name} is slowed down to real time while you watch it`),
      lost: () => this.tell(`${name} cannot be held at real time; trying again`),
    }));
  }
}
