/** All landings of the watched run: those so far while it collects, then those of the finished dataset. */

/** Time between two requests, while there are new throws. */
const PERIOD_MS = 2000;

/** Fetches landings for the map, also of throws that were not shown. */
export class Landings {
  #id = null;
  #following = 0;
  /** How many trials had ended at the last request. */
  #ended = 0;
  #hasAll = false;
  #timer = 0;

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
  }

  /** @param {import("./state.js").Instance} instance whose new landings are fetched, if the last request is old enough */
  follow(instance) {
    this.instance = instance;
    if (this.#timer || this.#hasAll || instance.kind !== "collection") return;
    const ended = instance.progress?.ended ?? 0;
    if (!instance.summary && (ended === this.#ended || document.hidden)) return;
    this.#ended = ended;
    this.#timer = setTimeout(() => this.#again(), PERIOD_MS);
    this.#fetch(this.#id);
  }

  #again() {
    this.#timer = 0;
    this.follow(this.instance);
  }

  async #fetch(id) {
    const path = `/collections/${encodeURIComponent(id)}/landings`;
    try {
      for (let hasMore = true; hasMore && id === this.#id && !this.#hasAll;) {
        const found = await this.connection.read("GET", `${path}?first=${this.#following}`);
        if (id !== this.#id) return;
        this.#hasAll = found.is_finished;
        this.#following = found.following;
        hasMore = found.has_more;
        if (found.is_finished) this.map.put(found.landings, found.total, found.outcomes);
        else this.map.addAll(found.landings);
      }
    } catch (error) {
      if (id !== this.#id) return;
      // Without a connection, the landings are requested again later.
      if (error.status === 0) this.#ended = -1;
      // If the dataset cannot be read, the map keeps the throws that were shown.
      else this.#hasAll = Boolean(this.instance.summary);
    }
  }
}
