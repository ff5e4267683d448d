/** The form that changes one sensor, with sliders. */

import { make, makeButton, setChoices, setText } from "./dom.js";
import { aimAlong, anglesTo, rpyOf } from "./sensor_frames.js";

/** Keys of three numbers: their words and bounds. */
const TRIPLES = {
  position_m: { words: ["x [m]", "y", "z"], most: 4 },
  look_at_m: { words: ["at x [m]", "y", "z"], most: 4 },
  rpy_rad: { words: ["roll [rad]", "pitch", "yaw"], most: 3.14 },
};
/** Other numbers, if a sensor has them: key, words, bounds and step. */
const NUMBERS = [
  ["vertical_fov_rad", "view [rad]", 0.2, 2.4, 0.01], ["width", "width", 8, 640, 8], ["height", "height", 8, 480, 8],
  ["near_m", "near [m]", 0.01, 2, 0.01], ["far_m", "far [m]", 1, 100, 1],
  ["rays", "rays", 1, 1440, 1], ["layers", "layers", 1, 64, 1], ["from_rad", "from [rad]", -3.14, 3.14, 0.01], ["to_rad", "to [rad]", -3.14, 3.14, 0.01],
  ["vertical_rad.0", "lowest [rad]", -1.5, 1.5, 0.01], ["vertical_rad.1", "highest [rad]", -1.5, 1.5, 0.01],
  ["range_m.0", "nearest [m]", 0.01, 5, 0.01], ["range_m.1", "farthest [m]", 1, 100, 1],
];
/** For this time, the form shows what the user has set, and not what comes back from the sensor [ms]. */
const SETTLES_MS = 1000;

/** Shows the keys of the sensor that was chosen, and reports what the user changes. */
export class SensorForm {
  #name = "";
  #section = {};
  #layout = "";
  #touchedAt = -Infinity;
  /** @type {Map<string, {input: HTMLInputElement, output: HTMLElement}>} */
  #fields = new Map();

  /**
   * @param {HTMLElement} element
   * @param {object} events
   * @param {(section: object) => void} events.changed called with the new section
   * @param {(section: object) => void} events.copied
   * @param {() => void} events.removed
   * @param {() => void} events.closed
   */
  constructor(element, { changed, copied, removed, closed }) {
    Object.assign(this, { element, changed });
    this.title = make("strong", {});
    this.link = make("select", {});
    this.aim = make("select", {}, make("option", { value: "look_at_m" }, "a point"), make("option", { value: "rpy_rad" }, "angles"));
    this.rows = make("div", {});
    this.link.addEventListener("change", () => this.#set("link", this.link.value));
    this.aim.addEventListener("change", () => this.#turn());
    const buttons = [makeButton("Copy as YAML", () => copied(this.#section)), makeButton("Remove", removed), makeButton("Close", closed)];
    element.append(
      make("div", { className: "row" }, this.title, make("label", {}, "Link ", this.link), make("label", {}, "Directed by ", this.aim), ...buttons),
      this.rows,
    );
  }

  /**
   * Show a sensor, unless the user changes the same one at the moment.
   * @param {import("./sensor_frames.js").Sensor} sensor
   */
  put({ name, position_m: place, rotation_xyzw: turn, section }) {
    if (name === this.#name && performance.now() - this.#touchedAt < SETTLES_MS) return;
    this.#name = name;
    // What is left out follows from other keys, and then has no values to change.
    const aimed = section.look_at_m ? {} : { rpy_rad: section.rpy_rad ?? rpyOf(turn) };
    this.#section = { ...section, position_m: section.position_m ?? place, ...aimed };
    this.#show();
  }

  /** @param {string[]} links that may carry the sensor */
  offer(links) {
    const { link = "world" } = this.#section;
    setChoices(this.link, [...new Set(["world", link, ...links])].map((name) => [name, name]));
    if (this.link !== document.activeElement) this.link.value = link;
  }

  #show() {
    setText(this.title, this.#name);
    this.aim.value = this.#section.look_at_m ? "look_at_m" : "rpy_rad";
    const numbers = NUMBERS.filter(([key]) => (this.#read(key) ?? null) !== null);
    const layout = [this.#name, this.aim.value, ...numbers.map(([key]) => key)].join();
    if (layout !== this.#layout) {
      this.#layout = layout;
      this.#fields.clear();
      const triples = ["position_m", this.aim.value].flatMap((key) => {
        const { words, most } = TRIPLES[key];
        return words.map((word, axis) => this.#makeSlider(`${key}.${axis}`, word, -most, most, 0.01));
      });
      const rows = [triples, numbers.map((each) => this.#makeSlider(...each))];
      this.rows.replaceChildren(...rows.map((row) => make("div", { className: "row" }, ...row)));
    }
    for (const [key, { input, output }] of this.#fields) {
      input.value = this.#read(key);
      setText(output, String(Number(this.#read(key).toPrecision(4))));
    }
  }

  #read(key) {
    const [name, index] = key.split(".");
    const value = this.#section[name];
    return index === undefined ? value : value?.[index];
  }

  #set(key, value) {
    const [name, index] = key.split(".");
    const whole = index === undefined ? value : this.#section[name].map((each, i) => (i === Number(index) ? value : each));
    this.#change({ ...this.#section, [name]: whole });
  }

  #change(section) {
    this.#section = section;
    this.#touchedAt = performance.now();
    this.#show();
    this.changed(section);
  }

  /** Direct the sensor by the other key, so that it still looks where it does. */
  #turn() {
    const { position_m: place, look_at_m: point, rpy_rad: angles } = this.#section;
    const isPoint = this.aim.value === "look_at_m";
    this.#change({ ...this.#section, look_at_m: isPoint ? (point ?? aimAlong(place, angles)) : null, rpy_rad: isPoint ? null : (angles ?? anglesTo(place, point)) });
  }

  #makeSlider(key, word, least, most, step) {
    const value = this.#read(key);
    const input = make("input", { type: "range", min: Math.min(least, value), max: Math.max(most, value), step });
    const output = make("output", {});
    input.addEventListener("input", () => this.#set(key, Number(input.value)));
    this.#fields.set(key, { input, output });
    return make("label", {}, `${word} `, input, output);
  }
}
