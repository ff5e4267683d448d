/** A model of the server's directory: its errors, what adapting did, and the parameters of a throw at a place. */

import { get, make, setChoices, setText } from "./dom.js";
import { drawErrors } from "./model_chart.js";
import { describe, median, tabulate } from "./model_words.js";

const HEIGHT = "scene.landing_height_m";
/** Ends of the names of targets that lie on the landing map, such as landing_x_m and rest_y_m. */
const PLACE = ["_x_m", "_y_m"];

/** The box of the page that shows one model. */
export class Models {
  #names = [];
  /** The model that is shown; null if none is. */
  #model = null;
  /** Numbers of the last requests; answers to earlier requests are ignored. */
  #chosen = 0;
  #aimed = 0;

  /**
   * @param {object} parts
   * @param {import("./connection.js").Connection} parts.connection
   * @param {import("./landing_map.js").LandingMap} parts.map
   * @param {() => void} parts.changed called when another model is shown, or none any more
   */
  constructor({ connection, map, changed }) {
    Object.assign(this, { connection, map, changed });
    get("model").addEventListener("change", () => this.#choose());
    get("model-throws").addEventListener("change", () => this.#showThrows());
    get("aim-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#aim();
    });
    // While the user was in another window, commands may have made or scored models.
    window.addEventListener("focus", () => this.list());
  }

  /** @returns {boolean} whether a model is shown that belongs on the landing map */
  get isOnMap() {
    return this.#model !== null && PLACE.every((end, i) => this.#model.targets[i]?.endsWith(end));
  }

  /** Fetch the names of all models, and the shown model again. */
  async list() {
    try {
      this.#names = await this.connection.read("GET", "/models");
    } catch {
      // The page already shows that the connection is lost.
      return;
    }
    get("model-box").hidden = !this.#names.length && !this.#model;
    setChoices(get("model"), [["", "none"], ...this.#names.map((name) => [name, name])]);
    if (this.#model || get("model").value) await this.#choose();
  }

  /**
   * Aim at a place, if a model is shown.
   * @param {number[]} place x, y, z [m], frame world
   */
  aimAt([x, y, z]) {
    if (!this.isOnMap) return;
    const [first, second] = this.#model.targets;
    const values = { [first]: x, [second]: y, [HEIGHT]: z };
    for (const [name, field] of this.#fields()) {
      if (name in values) field.value = values[name].toFixed(3);
    }
    this.#aim();
  }

  async #choose() {
    const name = get("model").value;
    const asked = ++this.#chosen;
    let model = null;
    let problem = "";
    try {
      if (name) model = await this.connection.read("GET", `/models/${encodeURIComponent(name)}`);
    } catch (error) {
      problem = error.message;
    }
    if (asked !== this.#chosen) return;
    const isAnother = model?.name !== this.#model?.name;
    this.#model = model;
    setText(get("model-text"), model ? describe(model) : problem);
    if (isAnother) {
      this.#makeFields();
      setText(get("aim-text"), "");
      get("aim-values").replaceChildren();
    }
    get("aim-form").hidden = model === null;
    this.#showErrors();
    this.#showThrows();
    if (isAnother) this.changed();
  }

  #showErrors() {
    const score = this.#model?.score ?? null;
    get("model-errors").hidden = score === null;
    get("model-charts").replaceChildren();
    const several = score !== null && score.adapted_throws.length > 0;
    get("model-throws-box").hidden = score === null || !this.isOnMap;
    setChoices(get("model-throws"), [["throws", "in its own world"], ...(several ? [["adapted_throws", "in the other one, adapted"]] : []), ["none", "none"]]);
    if (score === null) return;
    const rows = tabulate(score).map(([text, ...cells]) => make("tr", {}, make("th", { scope: "row" }, text), ...cells.map((cell) => make("td", {}, cell))));
    get("model-rows").replaceChildren(...rows);
    const place = get("model-charts");
    drawErrors(place, "throws learned from", score.trained.map(({ trained_on: count, errors }) => [count, errors]), { isLogarithmic: true });
    if (score.adapted.length) drawErrors(place, "throws in the other world", score.adapted.map(({ real_throws: count, errors }) => [count, errors]), { isLogarithmic: false });
  }

  #showThrows() {
    const throws = this.#model?.score?.[get("model-throws").value] ?? [];
    this.map.showModel(this.isOnMap ? { name: this.#model.name, reached: this.#model.reached, throws } : null);
  }

  #makeFields() {
    const names = this.#model ? [...this.#model.targets, ...this.#model.given] : [];
    const middle = (i) => median((this.#model?.reached ?? []).map((end) => end[i])) ?? 0;
    get("aim-fields").replaceChildren(...names.map((name, i) => make("label", {}, `${inWords(name)} `,
      make("input", { type: "number", step: "any", required: true, value: middle(i).toFixed(3), "data-name": name }))));
  }

  #fields() {
    return [...get("aim-fields").querySelectorAll("input")].map((field) => [field.dataset.name, field]);
  }

  async #aim() {
    const model = this.#model;
    const at = this.#fields().map(([, field]) => `at=${encodeURIComponent(field.value)}`).join("&");
    const asked = ++this.#aimed;
    let text;
    let values = {};
    try {
      const found = await this.connection.read("GET", `/models/${encodeURIComponent(model.name)}/aim?${at}`);
      const isFar = !found.reachable;
      text = isFar ? `Out of reach; the nearest throw ended at ${inPlaces(found.nearest)}.` : `Throw with these; it should end at ${inPlaces(found.predicted)}.`;
      values = isFar ? {} : found.parameters;
    } catch (error) {
      text = error.message;
    }
    if (asked !== this.#aimed) return;
    setText(get("aim-text"), text);
    get("aim-values").replaceChildren(...Object.entries(values).flatMap(([key, value]) => [make("dt", {}, key), make("dd", {}, String(Number(value.toPrecision(6))))]));
  }
}

function inWords(name) {
  const axis = PLACE.find((end) => name.endsWith(end));
  if (name === HEIGHT) return "z [m]";
  return axis ? `${axis[1]} [m]` : name;
}

function inPlaces(values) {
  return values.map((value) => value.toFixed(3)).join(", ");
}
