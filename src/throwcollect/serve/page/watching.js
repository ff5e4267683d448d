/** The view of one run: its newest throws, its robots, its landings. */

import { REPLAY } from "./replay.js";
import { Robot } from "./robot.js";
import { lives } from "./state.js";
import { StoredThrows } from "./stored_throws.js";
import { decodeThrow, jointsAt, posesAt } from "./throws.js";

/** Watches one run at a time, and only while the page is visible. */
export class Watching {
  /** @type {string | null} id of the run */
  id = null;
  #socket = null;
  #urdf = null;
  #scene = null;
  /** Whether the last request for the description failed, and the view says so. */
  #isMissed = false;
  /** @type {(simulation: string, urdf: string) => void} called with each description that is drawn */
  described = () => {};
  /** @type {() => void} called when the scene of the run is known */
  known = () => {};
  /** @type {import("./replay.js").Replay | null} */
  replay = null;

  /**
   * @param {object} parts
   * @param {import("./connection.js").Connection} parts.connection
   * @param {import("./scene.js").View} parts.view
   * @param {import("./playback.js").Playback} parts.playback
   * @param {import("./landing_map.js").LandingMap} parts.map
   * @param {import("./robot.js").Meshes} parts.meshes
   * @param {(text: string) => void} parts.tell says what is wrong
   */
  constructor({ connection, view, playback, map, meshes, tell }) {
    Object.assign(this, { connection, view, playback, map, meshes, tell });
    this.stored = new StoredThrows(connection, map);
    document.addEventListener("visibilitychange", () => this.#follow());
  }

  /** @param {import("./state.js").Instance | undefined} instance the run to show from now on; undefined for none */
  put(instance) {
    const id = instance?.id ?? null;
    if (id !== this.id) this.#begin(id);
    this.instance = instance;
    this.#follow();
    if (instance) {
      this.#fetchDescription();
      this.stored.follow(instance);
    }
  }

  /** @param {string[]} simulations to show */
  show(simulations) {
    this.view.show(simulations);
    for (const name of simulations) {
      const station = this.view.stations.get(name);
      if (station.robot === null && this.#urdf) this.describe(name, this.#urdf);
    }
  }

  /**
   * Draw the robot of a simulation as a description says, in its present posture.
   * @param {string} name of the simulation
   * @param {string} urdf
   */
  describe(name, urdf) {
    const station = this.view.stations.get(name);
    if (!station || !this.#scene || station.robot?.urdf === urdf) return;
    try {
      station.setRobot(new Robot(urdf, this.#scene, this.meshes, () => this.view.touch(), ({ message }) => this.tell(`a mesh is missing: ${message}`)));
      this.described(name, urdf);
    } catch (error) {
      this.tell(`the robot's description cannot be drawn: ${error.message}`);
    }
  }

  /**
   * Put robots and bodies where they are at the times of the replay.
   * @param {Set<string>} live simulations that others move
   */
  pose(live) {
    for (const name of this.view.shown) {
      const at = this.playback.at(name);
      if (!at || live.has(name)) continue;
      const station = this.view.stations.get(name);
      const { shown, time } = at;
      if (station.posed === shown && station.posedAt === time) continue;
      station.posed = shown;
      station.posedAt = time;
      station.robot?.move(jointsAt(shown, time).map((position, i) => [shown.joints[i], position]));
      station.bodies.move(posesAt(shown, time));
      station.trails.reveal(shown.duration ? time / shown.duration : 1);
      station.moveGhost(time);
      this.view.touch();
    }
  }

  /** @returns {string[]} names of the bodies that move in the run, with the object last; none before they are known */
  get moving() {
    return [...new Set((this.#scene?.bodies ?? []).filter(({ moves }) => moves).map(({ name }) => name))];
  }

  /** @param {import("./throws.js").Throw} shown begins to be replayed */
  begin(shown) {
    const station = this.view.stations.get(shown.simulation);
    const isStored = shown.simulation === REPLAY;
    if (station && isStored) {
      this.replay.dress(station);
      this.#fetchDescription();
    }
    station?.trails.add(shown);
    station?.bodies.put(shown.bodies);
    if (isStored) this.map.mark(shown, this.replay.compared);
    else if (this.view.shown.includes(shown.simulation)) this.map.mark(shown);
  }

  #begin(id) {
    this.id = id;
    this.#urdf = null;
    this.#scene = null;
    this.#isMissed = false;
    this.#socket?.close();
    this.#socket = null;
    this.view.clear();
    this.playback.clear();
    this.map.clear();
    this.stored.begin(id);
  }

  /** Listen for throws as long as the run can have some, and the page is visible. */
  #follow() {
    const { instance } = this;
    // Before it has robots, it may have no router, and the server would close the socket again and again.
    const wanted = instance?.kind === "collection" && lives(instance) && instance.robots.length > 0 && !document.hidden;
    if (wanted && this.#socket === null) {
      this.#socket = this.connection.open(`/instances/${encodeURIComponent(instance.id)}/shown`, {
        receive: (data) => this.#receive(decodeThrow(data)),
      });
    } else if (!wanted && this.#socket !== null) {
      this.#socket.close();
      this.#socket = null;
    }
  }

  #receive(newest) {
    this.playback.put(newest);
    this.map.add(newest);
  }

  /** Fetch the description of the robots, once the run has robots. */
  async #fetchDescription() {
    const { id, instance } = this;
    const run = `/instances/${encodeURIComponent(id)}`;
    // A run that has ended has no robots any more, but its dataset says what they looked like.
    const isStored = this.view.shown.includes(REPLAY);
    if (this.#urdf === null && (instance.robots.length || isStored)) {
      this.#urdf = "";
      const scene = await this.#ask(id, `${run}/scene`, (response) => response.json());
      const urdf = await this.#ask(id, `${run}/urdf`, (response) => response.text());
      if (this.id !== id) return;
      const isWhole = scene !== null && urdf !== null;
      // The next state makes another request for whatever the server has not given.
      this.#urdf = isWhole ? urdf : null;
      if (isWhole && this.#isMissed) this.tell("");
      this.#isMissed = !isWhole;
      if (scene !== null) {
        this.#scene = scene;
        this.map.aim(scene.target_distance_m);
        this.map.surround(scene.bodies);
        this.view.setBodies(scene.bodies);
        this.show(this.view.shown);
        this.known();
      }
    }
  }

  /** The server's answer to a request about a run; null if it fails, which the view says if the run is still watched. */
  async #ask(id, path, read) {
    try {
      return await read(await this.connection.ask("GET", path));
    } catch (error) {
      if (this.id === id) this.tell(error.message);
      return null;
    }
  }
}
