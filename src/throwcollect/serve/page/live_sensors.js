/** The sensors of one simulation that is shown live: what they see at the moment, by rosbridge. */

import { get } from "./dom.js";
import { paint, pointsOf } from "./sensor_frames.js";

/** Least time between two frames of a sensor [ms]. */
const PERIOD_MS = 100;
const IMAGE = "sensor_msgs/msg/Image";
const TOPICS = {
  color: ["image_raw", IMAGE], depth: ["depth/image_raw", IMAGE], segmentation: ["segmentation/image_raw", IMAGE],
  scan: ["scan", "sensor_msgs/msg/LaserScan"], points: ["points", "sensor_msgs/msg/PointCloud2"],
};
const STRING = 4;

const decode = (data) => Uint8Array.from(atob(data), (each) => each.charCodeAt(0)).buffer;

/**
 * @param {string} stream
 * @param {{encoding: string, width: number, height: number, data: string}} image a message with its data as base64
 * @returns {Uint8ClampedArray} red, green, blue and opacity of each pixel
 */
export function paintImage(stream, { encoding, width, height, data }) {
  let buffer = decode(data);
  // Millimetres, with 0 for none.
  if (encoding === "16UC1") ({ buffer } = Float32Array.from(new Uint16Array(buffer), (each) => each / 1000 || Infinity));
  return paint(stream, buffer, width * height);
}

/** Shows the sensors of a simulation while the strip is open for them, and changes them. */
export class LiveSensors {
  /** Name of the simulation that is shown live; empty if there is none, or there are several. */
  station = "";
  /** @type {Set<string>} topics of frames that the strip has subscribed to */
  #topics = new Set();
  #isOpen = false;
  /** Number of the connection that the subscriptions are of. */
  #connection = 0;
  /** @type {Record<string, object> | null} sections of all sensors as they are, or as the user wants them; null until they are known */
  #sections = null;
  #isAsking = false;
  #isChanged = false;

  /**
   * @param {object} parts
   * @param {import("./live.js").Live} parts.live
   * @param {import("./sensor_strip.js").SensorStrip} parts.strip
   */
  constructor({ live, strip }) {
    Object.assign(this, { live, strip });
    get("show-sensors").addEventListener("click", () => (this.#isOpen ? this.#close() : this.#open()));
  }

  /** See `Source`. */
  mayChange() {
    return true;
  }

  /** See `Source`. The node gets the newest sections when it has answered the request before. */
  async change(name, section) {
    if (!this.#sections) return;
    this.#sections = { ...this.#sections, [name]: section ?? undefined };
    this.#isChanged = true;
    if (this.#isAsking) return;
    this.#isAsking = true;
    try {
      while (this.#isChanged) {
        this.#isChanged = false;
        const value = { type: STRING, string_value: JSON.stringify(this.#sections) };
        const { results } = await this.live.call(`/${this.station}/sensors/set_parameters`, "rcl_interfaces/srv/SetParameters", { parameters: [{ name: "sensors", value }] });
        const { successful, reason } = results[0] ?? { reason: "its node has no sensors" };
        this.strip.tell(successful ? "" : reason);
        if (!successful && !this.#isChanged) this.#forget();
      }
    } catch ({ message }) {
      this.strip.tell(message);
      this.#forget();
    } finally {
      this.#isAsking = false;
    }
  }

  /** Follow the choice of the simulation that is shown live; called for each picture of the view. */
  follow() {
    const { connections, simulations } = this.live;
    const [name] = simulations.size === 1 ? simulations : [""];
    if (name === this.station && connections === this.#connection) return;
    const isSame = this.#isOpen && name === this.station;
    this.#close();
    this.station = name;
    this.#connection = connections;
    get("show-sensors").hidden = !name;
    if (isSame) this.#open();
  }

  #open() {
    this.#isOpen = true;
    this.#sections = null;
    get("show-sensors").setAttribute("aria-pressed", "true");
    this.strip.put(this, []);
    this.strip.tell("waiting for the sensors …");
    // This subscription lets the simulation start the node that renders pictures.
    this.live.subscribe(`/${this.station}/sensors`, "std_msgs/msg/String", ({ data }) => this.#put(JSON.parse(data)));
  }

  #close() {
    if (!this.#isOpen) return;
    this.#isOpen = false;
    for (const topic of [...this.#topics, `/${this.station}/sensors`]) this.live.unsubscribe(topic);
    this.#topics.clear();
    get("show-sensors").setAttribute("aria-pressed", "false");
    if (this.strip.source === this) this.strip.put(null, []);
  }

  #put(sensors) {
    if (!this.#isOpen) return;
    const isFirst = !this.#topics.size;
    if (!this.#isAsking) this.#forget(sensors);
    this.strip.put(this, sensors);
    if (isFirst) this.strip.tell(sensors.length ? "" : "this simulation has no sensors; add a camera");
    const wanted = new Map(this.strip.strands.map((strand) => [`/${this.station}/${strand.sensor.name}/${TOPICS[strand.stream][0]}`, strand]));
    for (const topic of [...this.#topics]) {
      if (wanted.has(topic)) continue;
      this.#topics.delete(topic);
      this.live.unsubscribe(topic);
    }
    for (const [topic, strand] of wanted) {
      if (this.#topics.has(topic)) continue;
      this.#topics.add(topic);
      this.live.subscribe(topic, TOPICS[strand.stream][1], (message) => this.#show(strand, message), PERIOD_MS);
    }
  }

  /** Forget what the user wanted: the sensors are as the node has them. */
  #forget(sensors = this.strip.sensors) {
    this.#sections = Object.fromEntries(sensors.map(({ name, section }) => [name, section]));
  }

  #show(strand, message) {
    if (strand.canvas) {
      strand.draw(paintImage(strand.stream, message), message);
      return;
    }
    const { station, view } = this.strip;
    // Infinite ranges are null in JSON.
    const buffer = message.ranges ? Float32Array.from(message.ranges, (range) => range ?? Infinity).buffer : decode(message.data);
    station?.sensors.setPoints(strand.sensor.name, pointsOf(strand.sensor, buffer), station.robot);
    view.touch();
  }
}
