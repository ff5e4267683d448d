/** Which throws are on the map, and next to each other: by outcome, and by the range of one swept parameter. */

import { get, setChoices } from "./dom.js";

/** @typedef {{hidden: string[], key: string, min: string, max: string}} FilterChoice */

/** The filter and its fields. */
export class Filter {
  /** @type {Set<string>} outcomes that are left out */
  hidden = new Set();
  /** The key of a layout, until a run has it. */
  #wanted = "";

  /** @param {() => void} changed called when the user has chosen something else */
  constructor(changed) {
    this.changed = changed;
    for (const name of ["key", "min", "max"]) get(`filter-${name}`).addEventListener("change", () => changed());
    get("filter-clear").addEventListener("click", () => {
      this.put({ hidden: [], key: "", min: "", max: "" });
      changed();
    });
  }

  /** @param {string[]} keys that are swept in the run that is watched */
  offer(keys) {
    setChoices(get("filter-key"), [["", "any"], ...keys.map((key) => [key, key])]);
    if (this.#wanted && keys.includes(this.#wanted)) {
      get("filter-key").value = this.#wanted;
      get("filter-box").open = true;
      this.#wanted = "";
    }
    get("filter-box").hidden = !keys.length;
  }

  /** @param {string} outcome is shown again if it is left out, and left out otherwise */
  toggle(outcome) {
    if (!this.hidden.delete(outcome)) this.hidden.add(outcome);
    this.changed();
  }

  /** @returns {FilterChoice} as a layout keeps it */
  get choice() {
    return { hidden: [...this.hidden], key: get("filter-key").value || this.#wanted, min: get("filter-min").value, max: get("filter-max").value };
  }

  /** @param {FilterChoice} choice */
  put({ hidden, key, min, max }) {
    this.hidden = new Set(hidden);
    this.#wanted = key;
    get("filter-key").value = key;
    get("filter-min").value = min;
    get("filter-max").value = max;
  }

  /** @returns {boolean} whether it leaves anything out */
  get isActive() {
    return this.hidden.size > 0 || this.#range !== null;
  }

  get #range() {
    const [key, min, max] = ["key", "min", "max"].map((name) => get(`filter-${name}`).value);
    if (!key || (min === "" && max === "")) return null;
    return { key, min: min === "" ? -Infinity : Number(min), max: max === "" ? Infinity : Number(max) };
  }

  /** @returns {(row: import("./throw_list.js").Row) => boolean} whether a throw is shown */
  get accepts() {
    const { hidden } = this;
    const range = this.#range;
    return ([, , outcome, , values]) => !hidden.has(outcome)
      && (range === null || (values !== undefined && values[range.key] >= range.min && values[range.key] <= range.max));
  }
}
