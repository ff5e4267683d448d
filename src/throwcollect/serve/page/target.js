/** The target: set by the user, published in the watched run, and the aim of collections. */

import { get, setChoices, setText, showProblem } from "./dom.js";

const TOPIC = "/target";
const TYPE = "geometry_msgs/msg/PointStamped";
/** Frame of places: below the robot's base on the ground, x forward, y to the left, z up. */
const FRAME = "world";
/** How far around the target a collection aims [m], and its number of rings. */
const AROUND_M = 0.1;
const RINGS = 4;
/** How far above and below the target the landing plane of such a collection may lie [m]. */
const ABOVE_M = 0.05;

/**
 * Keys with which a collection throws around a place.
 * @param {number[]} place [m], frame world
 * @param {string[]} targets keys that may stand in `sweep.target` of the collection
 * @returns {Record<string, unknown>}
 */
export function coverPlace([x, y, z], targets) {
  const distance = Math.hypot(x, y);
  const between = (middle, away, bins) => ({ min: round(Math.max(0, middle - away)), max: round(middle + away), bins });
  const height = Math.max(0, z);
  return {
    "sweep.target.distance_m": between(distance, AROUND_M, RINGS),
    // The sweep may vary the height of the landing plane; otherwise it is the same in all trials.
    ...(targets.includes("height_m") ? { "sweep.target.height_m": between(height, ABOVE_M, 1) } : { "scene.landing_height_m": round(height) }),
  };
}

function round(metres) {
  return Math.round(metres * 1000) / 1000;
}

/** The target, its fields, and the button that starts a collection for it. */
export class Target {
  /** @type {number[] | null} [m], frame world; null before it is set */
  place = null;
  /** In words, whether the target was published. */
  note = "";
  #components = [];

  /**
   * @param {object} parts
   * @param {import("./connection.js").Connection} parts.connection
   * @param {import("./scene.js").View} parts.view
   * @param {import("./landing_map.js").LandingMap} parts.map
   * @param {import("./live.js").Live} parts.live
   * @param {(id: string) => void} parts.watch shows a run
   * @param {(place: number[]) => void} parts.aim called with each place that is set
   */
  constructor({ connection, view, map, live, watch, aim }) {
    Object.assign(this, { connection, view, map, live, watch, aim });
    live.refused = (text) => this.#say(`not published: ${text}`);
    get("target-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.set(["x", "y", "z"].map((axis) => Number(get(`target-${axis}`).value)));
    });
    get("cover-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.cover();
    });
  }

  /** @returns {boolean} whether a collection could be started for it */
  get canBeCovered() {
    return this.place !== null && this.#components.length > 0;
  }

  /** @param {import("./state.js").State} state */
  put({ components }) {
    this.#components = components.filter(({ targets }) => targets.length > 0);
    setChoices(get("cover-component"), this.#components.map(({ name, pretty_name: text }) => [name, text]));
    this.#offer();
  }

  /**
   * Set the target to a place on the ground that the user has pointed at, at its present height.
   * @param {number} x [m], frame world
   * @param {number} y
   */
  setOnGround(x, y) {
    this.set([x, y, Number(get("target-z").value)]);
  }

  /** @param {number[]} place of the target [m], frame world; it is shown, and published in the run that is watched */
  set(place) {
    this.place = place;
    ["x", "y", "z"].forEach((axis, i) => {
      get(`target-${axis}`).value = place[i].toFixed(3);
    });
    this.view.setTarget(place);
    this.map.choose(place);
    this.aim(place);
    const [x, y, z] = place;
    try {
      this.live.publish(TOPIC, TYPE, { header: { frame_id: FRAME }, point: { x, y, z } });
      this.#say(`${Math.hypot(x, y).toFixed(2)} m from the robot; published as ${TOPIC}`);
    } catch (error) {
      this.#say(`not published: ${error.message}`);
    }
    this.#offer();
  }

  /** Start a collection whose throws come down around the target. */
  async cover() {
    if (!this.canBeCovered) return;
    const { name, targets } = this.#components.find((each) => each.name === get("cover-component").value) ?? this.#components[0];
    const problem = get("cover-problem");
    showProblem(problem, null);
    try {
      const body = { component: name, set: coverPlace(this.place, targets) };
      const instance = await this.connection.read("POST", "/instances", body);
      this.#say(`${instance.id} collects around the target`);
      this.watch(instance.id);
    } catch (error) {
      showProblem(problem, error);
      this.note = `no collection: ${error.message}`;
    }
  }

  #say(text) {
    this.note = text;
    setText(get("target-note"), text);
  }

  #offer() {
    get("cover-form").hidden = !this.canBeCovered;
  }
}
