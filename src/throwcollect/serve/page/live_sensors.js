/** The strip of sensors of one simulation that is shown live: what they see at the moment, and sliders that change them. */

import { get, make, makeButton, setText } from "./dom.js";
import { paint, toYaml } from "./sensor_frames.js";

const IMAGE = "sensor_msgs/msg/Image";
/** Least time between two pictures of a camera [ms]. */
const PERIOD_MS = 100;
/** Farthest that sliders go from zero [m or rad; pixels and other integers], unless the value is farther already. */
const [REACH, INTEGER_REACH] = [4, 640];
/** How often the page looks for cameras, and the time in between. */
const [TRIES, WAIT_MS] = [10, 2000];
const STREAMS = { rgb8: "color", "16UC1": "depth", "32FC1": "depth", mono16: "segmentation" };
const [INTEGER, DOUBLE] = [2, 3];
const VALUES = { 1: "bool_value", [INTEGER]: "integer_value", [DOUBLE]: "double_value", 4: "string_value" };

/**
 * @param {{encoding: string, width: number, height: number, data: string}} image a message with its data as base64
 * @returns {Uint8ClampedArray | null} red, green, blue and opacity of each pixel; null if its encoding is not known
 */
export function paintImage({ encoding, width, height, data }) {
  const stream = STREAMS[encoding];
  if (!stream) return null;
  let { buffer } = Uint8Array.from(atob(data), (each) => each.charCodeAt(0));
  // Millimetres, with 0 for none.
  if (encoding === "16UC1") ({ buffer } = Float32Array.from(new Uint16Array(buffer), (each) => each / 1000 || Infinity));
  return paint(stream, buffer, width * height);
}

/**
 * @param {[string, unknown][]} values by parameter, such as sensors.head.rpy_rad.1
 * @returns {Record<string, Record<string, any>>} sections by sensor
 */
export function nest(values) {
  const whole = {};
  for (const [name, value] of values) {
    const keys = name.split(".").slice(1);
    const last = keys.pop();
    let place = whole;
    keys.forEach((key, i) => {
      place[key] ??= /^\d+$/.test(keys[i + 1] ?? last) ? [] : {};
      place = place[key];
    });
    place[last] = value;
  }
  return whole;
}

/** Shows the sensors of a simulation while the strip is open. */
export class LiveSensors {
  #simulation = "";
  /** @type {string[]} topics of its pictures */
  #offered = [];
  /** @type {string[]} topics of pictures that the strip has subscribed to */
  #topics = [];
  /** @type {Map<string, unknown>} values of the parameters of the node */
  #values = new Map();
  #isOpen = false;
  #isAsked = false;

  /** @param {import("./live.js").Live} live */
  constructor(live) {
    this.live = live;
    get("show-sensors").addEventListener("click", () => (this.#isOpen ? this.#close() : this.#open()));
  }

  /** Follow the choice of the simulation that is shown live; called for each picture of the view. */
  follow() {
    const { simulations } = this.live;
    const [name] = simulations.size === 1 ? simulations : [""];
    if (name === this.#simulation) return;
    this.#close();
    this.#simulation = name;
    get("show-sensors").hidden = true;
    if (name) this.#find(name);
  }

  /** Offer the strip if the simulation has cameras; the connection may be open, and topics known, a little later. */
  async #find(name) {
    for (let tries = 0; tries < TRIES && name === this.#simulation; tries++) {
      const found = await this.live.call("/rosapi/topics_for_type", "rosapi_msgs/srv/TopicsForType", { type: IMAGE }).catch(() => null);
      if (name !== this.#simulation) return;
      this.#offered = (found?.topics ?? []).filter((topic) => topic.startsWith(`/${name}/`)).sort();
      get("show-sensors").hidden = !this.#offered.length;
      if (this.#offered.length) return;
      await new Promise((resolve) => setTimeout(resolve, WAIT_MS));
    }
  }

  #open() {
    this.#isOpen = true;
    this.#isAsked = false;
    get("show-sensors").setAttribute("aria-pressed", "true");
    get("live-sensors").hidden = false;
    setText(get("live-sensors-note"), "waiting for the first pictures …");
    this.#topics = this.#offered;
    for (const topic of this.#topics) {
      const title = topic.split("/").slice(2, -1).join(": ");
      const canvas = make("canvas", { role: "img", "aria-label": `live picture of ${title}` });
      get("live-pictures").append(make("figure", {}, canvas, make("figcaption", {}, title)));
      this.live.subscribe(topic, IMAGE, (image) => this.#draw(canvas, image), PERIOD_MS);
    }
  }

  #close() {
    for (const topic of this.#topics) this.live.unsubscribe(topic);
    this.#topics = [];
    this.#isOpen = false;
    this.#values.clear();
    get("show-sensors").setAttribute("aria-pressed", "false");
    get("live-sensors").hidden = true;
    get("live-pictures").replaceChildren();
    get("live-keys").replaceChildren();
  }

  #draw(canvas, image) {
    const { width, height } = image;
    const pixels = paintImage(image);
    if (!pixels) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    canvas.getContext("2d").putImageData(new ImageData(pixels, width, height), 0, 0);
    // The node of the sensors has been started by the subscription, so its parameters are there now.
    if (!this.#isAsked) this.#fetchKeys();
  }

  async #fetchKeys() {
    this.#isAsked = true;
    setText(get("live-sensors-note"), "");
    const name = this.#simulation;
    const ask = (what, args) => this.#ask(`/${name}/sensors/${what}`, `rcl_interfaces/srv/${what.replace(/(^|_)(\w)/g, (_all, _dash, letter) => letter.toUpperCase())}`, args);
    const listed = await ask("list_parameters", { prefixes: ["sensors"], depth: 0 });
    const names = listed?.result.names ?? [];
    const [described, given] = await Promise.all([ask("describe_parameters", { names }), ask("get_parameters", { names })]);
    if (!described || !given || !this.#isOpen || name !== this.#simulation) return;
    described.descriptors.forEach((each, i) => this.#values.set(each.name, given.values[i][VALUES[each.type]]));
    const sliders = described.descriptors.flatMap((each) => {
      const [range] = [...each.floating_point_range, ...each.integer_range];
      return range && !each.read_only ? [this.#makeSlider(each, range)] : [];
    });
    const copy = makeButton("Copy as YAML", () => this.#copy());
    get("live-keys").replaceChildren(make("div", { className: "row" }, ...sliders), make("div", { className: "row" }, copy));
  }

  #makeSlider({ name, type, description }, { from_value: from, to_value: to }) {
    const value = this.#values.get(name);
    const isMetric = type === DOUBLE;
    const reach = Math.max(isMetric ? REACH : INTEGER_REACH, Math.abs(value));
    const input = make("input", { type: "range", min: Math.max(from, -reach), max: Math.min(to, reach), step: isMetric ? 0.01 : 1, value, title: description });
    const output = make("output", {}, String(value));
    input.addEventListener("input", () => this.#set(name, type, Number(input.value), output));
    return make("label", {}, `${name.replace(/^sensors\./, "")} `, input, output);
  }

  async #set(name, type, value, output) {
    setText(output, String(value));
    const parameters = [{ name, value: { type, [VALUES[type]]: value } }];
    const answer = await this.#ask(`/${this.#simulation}/sensors/set_parameters`, "rcl_interfaces/srv/SetParameters", { parameters });
    if (!answer) return;
    const [{ successful, reason }] = answer.results;
    if (successful) this.#values.set(name, value);
    setText(get("live-sensors-note"), successful ? "" : reason);
  }

  async #copy() {
    const text = Object.entries(nest([...this.#values])).map(([name, section]) => toYaml(name, section)).join("").replaceAll(/(?<=\n)sensors:\n/g, "");
    try {
      await navigator.clipboard.writeText(text);
      setText(get("live-sensors-note"), "the sensors are copied as YAML");
    } catch {
      setText(get("live-sensors-note"), text);
    }
  }

  async #ask(service, type, args) {
    try {
      return await this.live.call(service, type, args);
    } catch ({ message }) {
      setText(get("live-sensors-note"), message);
      return null;
    }
  }
}
