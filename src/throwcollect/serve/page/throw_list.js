/** The throws of a run: how each ended, where, and with which values; of very many, an even selection. */

/** Most throws that are kept of those with a place, and of the others. */
const MOST = 20000;

/** @typedef {[number | null, number | null, string, number, Record<string, number>?]} Row x, y [m], outcome, trial, swept values */

/** Rows; if there are too many, every second one is dropped, now and of all later ones. */
class EvenSelection {
  /** @type {Row[]} */
  rows = [];
  total = 0;
  #stride = 1;

  push(row) {
    this.total += 1;
    if ((this.total - 1) % this.#stride) return;
    this.rows.push(row);
    if (this.rows.length <= MOST) return;
    this.rows = this.rows.filter((_, i) => i % 2 === 0);
    this.#stride *= 2;
  }
}

/** Collects throws, in any order. */
export class ThrowList {
  #placed = new EvenSelection();
  #others = new EvenSelection();
  #trials = new Set();
  /** @type {Map<string, number>} how many throws ended with each outcome, kept or not */
  outcomes = new Map();
  /** @type {Row[] | null} */
  #ordered = null;

  /** @param {Row[]} rows those of trials that are known already are left out */
  add(rows) {
    for (const row of rows) {
      const [x, y, outcome, trial] = row;
      if (this.#trials.has(trial)) continue;
      this.#trials.add(trial);
      this.outcomes.set(outcome, (this.outcomes.get(outcome) ?? 0) + 1);
      (Number.isFinite(x) && Number.isFinite(y) ? this.#placed : this.#others).push(row);
    }
    this.#ordered = null;
  }

  /** @returns {Row[]} those that are kept and have a place */
  get placed() {
    return this.#placed.rows;
  }

  /** @returns {number} how many throws have a place, kept or not */
  get total() {
    return this.#placed.total;
  }

  /** Say how many throws with a place, and with each outcome, there are besides those that are kept. */
  setTotals(total, outcomes) {
    this.#placed.total = total;
    this.outcomes = new Map(Object.entries(outcomes));
  }

  /** @returns {Row[]} all that are kept, in the order of trials */
  get ordered() {
    this.#ordered ??= [...this.#placed.rows, ...this.#others.rows].sort(([, , , a], [, , , b]) => a - b);
    return this.#ordered;
  }

  /**
   * The throw before or after a trial, which need not be in the list.
   * @param {number | null} trial null to begin at the first or the last throw
   * @param {1 | -1} by
   * @param {(row: Row) => boolean} accepts
   * @returns {number | null} its trial; null if there is none
   */
  find(trial, by, accepts) {
    const rows = by > 0 ? this.ordered : [...this.ordered].reverse();
    const found = rows.find((row) => (trial === null || (row[3] - trial) * by > 0) && accepts(row));
    return found ? found[3] : null;
  }
}
