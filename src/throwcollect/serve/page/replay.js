/** Replays stored throws: one at a time, or one over the trail of another; of runs that live and of those that have ended. */

import { get, setText } from "./dom.js";
import { keepLayout, readLayout } from "./layout.js";
import { decodeThrow } from "./throws.js";
import { capitalize } from "./words.js";

/** Name of the place in the view where stored throws are replayed; no simulation has it. */
export const REPLAY = "replay";

/** @typedef {import("./throws.js").Throw} Throw */

/** The stored throw that is replayed, and the bar below the view. */
export class Replay {
  /** @type {Throw | null} */
  shown = null;
  /** @type {Throw | null} the throw that it is compared with */
  compared = null;
  #run = null;
  /** Grows with each request, so that a late answer does not replace a newer one. */
  #asked = 0;

  /**
   * @param {object} parts
   * @param {import("./connection.js").Connection} parts.connection
   * @param {import("./scene.js").View} parts.view
   * @param {import("./playback.js").Playback} parts.playback
   * @param {import("./landing_map.js").LandingMap} parts.map
   * @param {(text: string) => void} parts.tell says what is wrong
   * @param {() => void} parts.changed called when a stored throw is replayed, and when none is any more
   */
  constructor({ connection, view, playback, map, tell, changed }) {
    Object.assign(this, { connection, view, playback, map, tell, changed });
    get("stored-before").addEventListener("click", () => this.step(-1));
    get("stored-after").addEventListener("click", () => this.step(1));
    get("stored-trial").addEventListener("change", ({ target }) => target.value !== "" && this.show(Number(target.value)));
    get("compare").addEventListener("click", () => this.compare());
    get("copy-link").addEventListener("click", () => this.#copy());
    get("picture").addEventListener("click", () => this.#save());
    get("newest").addEventListener("click", () => this.leave());
  }

  /** @returns {boolean} whether a stored throw is replayed, or will be when it has come */
  get isOn() {
    return this.shown !== null;
  }

  /** @param {string | null} run whose throws are replayed from now on */
  begin(run) {
    this.#asked += 1;
    this.#run = run;
    this.shown = this.compared = null;
    const kept = readLayout().compared;
    if (run !== null && kept?.run === run) this.#fetch(kept.trial).then((other) => this.#putCompared(other), () => keepLayout({ compared: null }));
  }

  /**
   * Replay a stored throw.
   * @param {number} trial
   * @param {number | null} [other] trial that it is compared with; by default, the same as before
   */
  async show(trial, other = null) {
    const asked = ++this.#asked;
    try {
      const [found, compared] = await Promise.all([this.#fetch(trial), other === null ? null : this.#fetch(other)]);
      if (asked !== this.#asked) return;
      this.shown = found;
      if (compared) this.#putCompared(compared);
      this.tell("");
      // The station has to be there before the throw begins.
      this.changed();
      this.playback.show(found);
    } catch (error) {
      if (asked === this.#asked) this.tell(error.message);
    }
    this.put();
  }

  /** @param {1 | -1} by replay the next or the previous throw that the filter shows */
  step(by) {
    const trial = this.map.list.find(this.shown?.trial ?? null, by, this.map.filter.accepts);
    if (trial !== null) this.show(trial);
  }

  /** Compare later throws with this one, or end that. */
  compare() {
    this.#putCompared(this.compared ? null : this.shown);
    keepLayout({ compared: this.compared ? { run: this.#run, trial: this.compared.trial } : null });
  }

  /** Show the newest throws of the simulations again. */
  leave() {
    if (!this.isOn) return;
    this.#asked += 1;
    this.shown = null;
    this.map.mark(null);
    this.changed();
    this.put();
  }

  /**
   * Put the trail of the other throw beside that of the throw whose replay begins.
   * @param {import("./scene.js").Station} station
   */
  dress(station) {
    station.trails.clear();
    const other = this.compared?.trial === this.shown?.trial ? null : this.compared;
    if (other) station.trails.add(other);
    station.setGhost(other);
  }

  /** Show in the bar which throw is replayed. */
  put() {
    const { list, filter, words } = this.map;
    const rows = list.ordered;
    const trial = this.shown?.trial ?? null;
    get("stored").hidden = !rows.length && !this.isOn;
    setText(get("stored-noun"), capitalize(words.noun));
    const field = get("stored-trial");
    if (document.activeElement !== field) field.value = trial === null ? "" : String(trial);
    const matching = filter.isActive ? `${rows.filter(filter.accepts).length} of ` : "";
    setText(get("stored-count"), `${matching}${rows.length} ${words.noun}s`);
    get("stored-before").disabled = list.find(trial, -1, filter.accepts) === null;
    get("stored-after").disabled = list.find(trial, 1, filter.accepts) === null;
    const button = get("compare");
    button.disabled = !this.isOn && !this.compared;
    button.setAttribute("aria-pressed", String(this.compared !== null));
    setText(button, this.compared ? `Compared with ${this.compared.trial}` : "Compare");
    get("copy-link").hidden = !this.isOn;
    const address = this.isOn ? `#${this.link}` : "";
    if (location.hash !== address && !location.hash.includes("code=")) history.replaceState(null, "", location.pathname + location.search + address);
  }

  /** @returns {string} fragment of the address that opens this throw again */
  get link() {
    const parts = { run: this.#run, trial: this.shown.trial, ...(this.compared ? { compared: this.compared.trial } : {}) };
    return new URLSearchParams(parts).toString();
  }

  /** @returns {string} path of this throw below the interface */
  get path() {
    return this.#pathOf(this.shown.trial);
  }

  #pathOf(trial) {
    return `/collections/${encodeURIComponent(this.#run)}/throws/${trial}`;
  }

  #putCompared(other) {
    this.compared = other;
    if (this.isOn) {
      const station = this.view.stations.get(REPLAY);
      if (station) {
        this.dress(station);
        station.trails.add(this.shown);
        station.posed = null;
      }
      this.view.touch();
    }
    this.map.mark(this.shown, other);
    this.put();
  }

  async #fetch(trial) {
    const found = decodeThrow(await (await this.connection.ask("GET", this.#pathOf(trial))).arrayBuffer());
    return { ...found, simulation: REPLAY };
  }

  async #copy() {
    try {
      await navigator.clipboard.writeText(location.href);
      this.tell("the link is copied; to open it, one needs the token of this server");
    } catch {
      this.tell("the address of this page is the link");
    }
  }

  async #save() {
    const name = [this.#run, ...(this.isOn ? ["trial", this.shown.trial] : [])].join("-");
    await this.view.savePicture(`${name}.png`);
    this.tell(`${name}.png is saved where the browser puts downloads`);
  }
}
