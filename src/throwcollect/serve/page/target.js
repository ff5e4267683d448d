/** The target: set by the user, and published in the watched run. */

import { get, setText } from "./dom.js";

const TOPIC = "/target";
const TYPE = "geometry_msgs/msg/PointStamped";
/** Frame of places: below the robot's base on the ground, x forward, y to the left, z up. */
const FRAME = "world";

/** The target and its fields. */
export class Target {
  /** @type {number[] | null} [m], frame world; null before it is set */
  place = null;
  /** In words, whether the target was published. */
  note = "";

  /**
   * @param {object} parts
   * @param {import("./scene.js").View} parts.view
   * @param {import("./landing_map.js").LandingMap} parts.map
   * @param {import("./live.js").Live} parts.live
   * @param {(place: number[]) => void} parts.aim called with each place that is set
   */
  constructor({ view, map, live, aim }) {
    Object.assign(this, { view, map, live, aim });
    live.refused = (text) => this.#say(`not published: ${text}`);
    get("target-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.set(["x", "y", "z"].map((axis) => Number(get(`target-${axis}`).value)));
    });
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
  }

  #say(text) {
    this.note = text;
    setText(get("target-note"), text);
  }
}
