/** Words for what a task does: a throw that lands, a slide that comes to rest, or another trial. */

/**
 * @typedef {object} Words
 * @property {string} noun for a trial
 * @property {string} end for the place where it ends
 */

/** @type {Words} */
export const THROWS = { noun: "throw", end: "landing" };

/** @param {string} word */
export function capitalize(word) {
  return word.charAt(0).toUpperCase() + word.slice(1);
}

/**
 * @param {Words} words
 * @returns {string} title of the map of their places
 */
export function nameMap({ end }) {
  return end === "landing" ? "Landing map" : `Map of ${end}s`;
}

/**
 * @param {number} number
 * @param {string} noun
 * @returns {string} such as `1 slide` and `2 slides`
 */
export function count(number, noun) {
  return `${number} ${noun}${number === 1 ? "" : "s"}`;
}
