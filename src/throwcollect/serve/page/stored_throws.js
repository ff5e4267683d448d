/** All throws of the watched run: those so far while it collects, then those of the finished dataset. */

import { lives } from "./state.js";

/** Time between two requests, while there are new throws. */
const PERIOD_MS = 2000;

/** Fetches the throws of a run for the map and the filter, also those that were not shown. */
export class StoredThrows {
  #id = null;
  #following = 0;
  /** How many trials had ended at the last request. */
  #ended = 0;
  #hasAll = false;
  #timer = 0;
  /** Why the server has no throws of the run; empty if it has some, or was not asked yet. */
  problem = "";
  /** @type {() => void} called when throws have come, or the server has none */
  came = () => {};

  /**
   * @param {import("./connection.js").Connection} connection
   * @param {import("./landing_map.js").LandingMap} map
   */
  constructor(connection, map) {
    Object.assign(this, { connection, map });
  }

  /** @param {string | null} id of the run that is watched from now on */
  begin(id) {
    clearTimeout(this.#timer);
    this.#timer = 0;
    this.#id = id;
    this.#following = this.#ended = 0;
    this.#hasAll = false;
    this.problem = "";
  }

  /** @param {import("./state.js").Instance} instance whose new throws are fetched, if the last request is old enough */
  follow(instance) {
    this.instance = instance;
    if (this.#timer || this.#hasAll || instance.kind !== "collection") return;
    const ended = instance.progress?.ended ?? 0;
    // Of a run that has ended, all that is stored is fetched once.
    if (lives(instance) && !instance.summary && (ended === this.#ended || document.hidden)) return;
    this.#ended = ended;
    this.#timer = setTimeout(() => this.#again(), PERIOD_MS);
    this.#fetch(this.#id);
  }

  #again() {
    this.#timer = 0;
    this.follow(this.instance);
  }

  async #fetch(id) {
    const path = `/collections/${encodeURIComponent(id)}/throws`;
    try {
      for (let hasMore = true; hasMore && id === this.#id && !this.#hasAll;) {
        const found = await this.connection.read("GET", `${path}?first=${this.#following}`);
        if (id !== this.#id) return;
        hasMore = found.has_more;
        this.#hasAll = found.is_finished || (!hasMore && !lives(this.instance));
        this.#following = found.following;
        this.problem = "";
        this.map.know(found);
        if (found.is_finished) this.map.put(toRows(found), found.total, found.counts);
        else this.map.addAll(toRows(found));
        this.came();
      }
    } catch (error) {
      if (id !== this.#id) return;
      // Without a connection, the throws are requested again later.
      if (error.status === 0) this.#ended = -1;
      else {
        // The server cannot read a dataset in a volume of a container engine; the map keeps the throws that were shown.
        this.#hasAll = Boolean(this.instance.summary) || !lives(this.instance);
        this.problem = error.message;
        this.came();
      }
    }
  }
}

/**
 * @param {{trial: number[], outcome: string[], x_m: (number | null)[], y_m: (number | null)[], values: Record<string, number[]>}} columns
 * @returns {import("./throw_list.js").Row[]}
 */
export function toRows({ trial, outcome, x_m, y_m, values }) {
  const columns = Object.entries(values);
  return trial.map((number, i) => [x_m[i], y_m[i], outcome[i], number, Object.fromEntries(columns.map(([key, column]) => [key, column[i]]))]);
}
