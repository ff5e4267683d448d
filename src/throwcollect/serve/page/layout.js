/** What a browser remembers from visit to visit: speed, filter, plots, and the throw that others are compared with. */

const KEPT = "throwcollect.layout";

/**
 * @typedef {object} Layout
 * @property {string} [speed]
 * @property {import("./filter.js").FilterChoice} [filter]
 * @property {{choice: import("./plot_panel.js").Choice, follows: boolean}[]} [plots]
 * @property {{run: string, trial: number} | null} [compared]
 */

/** @returns {Layout} nothing if the browser keeps none */
export function readLayout() {
  try {
    return JSON.parse(localStorage.getItem(KEPT) ?? "{}") ?? {};
  } catch {
    return {};
  }
}

/** @param {Layout} changes */
export function keepLayout(changes) {
  try {
    localStorage.setItem(KEPT, JSON.stringify({ ...readLayout(), ...changes }));
  } catch {
    // A browser may keep nothing, as in a private window.
  }
}
