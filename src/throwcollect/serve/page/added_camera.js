/** A camera that is not recorded: a form with its keys, and the picture that the server renders. */

import { get, make, makeButton, setChoices, setText } from "./dom.js";
import { paint } from "./sensor_frames.js";

/** @typedef {import("./sensor_frames.js").Sensor} Sensor */

/** Keys with several numbers: their words, bounds and first values. */
const TRIPLES = {
  position_m: { words: ["x [m]", "y", "z"], least: -4, most: 4, values: [1, -3, 1.5] },
  look_at_m: { words: ["at x [m]", "y", "z"], least: -4, most: 4, values: [0.6, 0, 1] },
  rpy_rad: { words: ["roll [rad]", "pitch", "yaw"], least: -3.14, most: 3.14, values: [0, 0, 0] },
};
const NAME = "camera";

/** The form *Add a camera*. */
export class AddedCamera {
  /** @type {Sensor | null} the camera as it was rendered last; null if there is none */
  summary = null;
  #fields = new Map();
  #asked = "";
  #isAsking = false;

  /**
   * @param {object} parts
   * @param {import("./connection.js").Connection} parts.connection
   * @param {(name: string, section: object) => void} parts.copy copies a section as YAML
   * @param {() => void} parts.changed called when the camera looks somewhere else, or is there no more
   */
  constructor({ connection, copy, changed }) {
    Object.assign(this, { connection, changed });
    this.canvas = make("canvas", { role: "img", "aria-label": "picture of the added camera" });
    this.link = make("select", {});
    this.aim = make("select", {}, make("option", { value: "look_at_m" }, "a point"), make("option", { value: "rpy_rad" }, "angles"));
    this.groups = Object.fromEntries(Object.keys(TRIPLES).map((key) => [key, this.#makeTriple(key)]));
    this.aim.addEventListener("change", () => this.#showAim());
    get("camera-form").append(
      make("figure", {}, this.canvas),
      make(
        "div", { id: "camera-keys" },
        make("div", { className: "row" }, make("label", {}, "Link ", this.link), make("label", {}, "Directed by ", this.aim)),
        ...Object.values(this.groups),
        make("div", { className: "row" }, this.#makeSlider("vertical_fov_rad", "view [rad]", { least: 0.2, most: 2.4, value: 1.05 }), this.#makeSize("width", 160), this.#makeSize("height", 120)),
        make("div", { className: "row" }, makeButton("Copy as YAML", () => copy(NAME, this.section)), makeButton("Remove", () => this.#open(false))),
      ),
    );
    this.#showAim();
    get("add-camera").addEventListener("click", () => this.#open(get("camera-form").hidden));
  }

  /** @returns {Record<string, any>} section of the camera, as in a configuration */
  get section() {
    const number = (key) => Number(this.#fields.get(key).value);
    const triple = (key) => [0, 1, 2].map((axis) => number(`${key}.${axis}`));
    return {
      kind: "camera", link: this.link.value || "world", position_m: triple("position_m"), [this.aim.value]: triple(this.aim.value),
      width: number("width"), height: number("height"), vertical_fov_rad: number("vertical_fov_rad"),
    };
  }

  /**
   * Show what the camera sees, if it or the time has changed.
   * @param {string} path of the throw below the interface
   * @param {number} time [s]
   * @param {import("./robot.js").Robot | null} robot
   */
  async follow(path, time, robot) {
    if (get("camera-form").hidden) return;
    setChoices(this.link, ["world", ...(robot?.links ?? []).filter((name) => name !== "world")].map((name) => [name, name]));
    const body = { camera: this.section, time_s: time };
    const wanted = JSON.stringify([path, body]);
    // The server lets the next picture wait, so that it renders ten a second at most.
    if (this.#isAsking || wanted === this.#asked) return;
    this.#isAsking = true;
    this.#asked = wanted;
    try {
      const answer = await this.connection.ask("POST", `${path}/picture`, body);
      const before = JSON.stringify(this.summary?.section);
      const summary = JSON.parse(answer.headers.get("Sensor"));
      const pixels = await answer.arrayBuffer();
      if (get("camera-form").hidden) return;
      this.#draw(summary.section, pixels);
      this.summary = summary;
      if (before !== JSON.stringify(summary.section)) this.changed();
      setText(get("sensors-note"), "");
    } catch (error) {
      setText(get("sensors-note"), error.message);
    } finally {
      this.#isAsking = false;
    }
  }

  #draw({ width, height }, pixels) {
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    this.canvas.getContext("2d").putImageData(new ImageData(paint("color", pixels, width * height), width, height), 0, 0);
  }

  #open(isOpen) {
    get("camera-form").hidden = !isOpen;
    get("add-camera").setAttribute("aria-expanded", String(isOpen));
    this.#asked = "";
    if (isOpen || !this.summary) return;
    this.summary = null;
    this.changed();
  }

  #showAim() {
    for (const key of ["look_at_m", "rpy_rad"]) this.groups[key].hidden = key !== this.aim.value;
  }

  #makeTriple(key) {
    const { words, least, most, values } = TRIPLES[key];
    const sliders = words.map((word, axis) => this.#makeSlider(`${key}.${axis}`, word, { least, most, value: values[axis] }));
    return make("div", { className: "row" }, ...sliders);
  }

  #makeSlider(key, word, { least, most, value }) {
    const input = make("input", { type: "range", min: least, max: most, step: 0.01, value });
    const output = make("output", {}, String(value));
    input.addEventListener("input", () => setText(output, input.value));
    this.#fields.set(key, input);
    return make("label", {}, `${word} `, input, output);
  }

  #makeSize(key, value) {
    const input = make("input", { type: "number", min: 8, max: 640, step: 8, value });
    this.#fields.set(key, input);
    return make("label", {}, `${key} `, input);
  }
}
