/** What is known of a model, in words. */

/** Lengths are told in them. */
export const CENTIMETRES = 100;

/**
 * @param {number | null} length [m]
 * @returns {string}
 */
function inCentimetres(length) {
  return length === null ? "–" : `${(length * CENTIMETRES).toFixed(2)} cm`;
}

/**
 * @param {number | null} length over all targets
 * @param {string[]} targets whose names end with their units
 * @returns {string} one of several units has no name
 */
function tellLength(length, targets) {
  return length === null || targets.every((each) => each.endsWith("_m")) ? inCentimetres(length) : `${short(length)} (over targets of several units)`;
}

/**
 * What is known of a model, in sentences.
 * @param {any} model as the server tells it
 * @returns {string}
 */
export function describe({ learned_from: name, throws, error, parameters, targets, adaptation, score }) {
  const texts = [`Learned from ${throws} throws of ${name}: ${parameters.join(", ")} to ${targets.join(", ")}.`,
    `Throws that polynomials were not fitted to are predicted to ${tellLength(error, targets)} (median).`];
  if (adaptation) {
    const { method, throws: count, before, after, found } = adaptation;
    texts.push(`Adapted by ${count} ${count === 1 ? "throw" : "throws"} (${method}): they ended ${tellLength(median(before), targets)} from their prediction before`
      + `${after.length ? `, and ${tellLength(median(after), targets)} after, each predicted by the others` : ""} (median).`);
    if (found.length) texts.push(`Found: ${found.map(({ name: key, value, deviation }) => `${key} ${short(value)} ± ${short(deviation)}`).join(", ")}.`);
  }
  texts.push(score ? `All distances below are those of throws in simulation, at ${score.targets} targets${score.seeds > 1 ? ` of each of ${score.seeds} seeds` : ""}.` : "Nobody has thrown with it yet; throwcollect score does, in simulation.");
  return texts.join(" ");
}

/** Rows of the table of errors: what was thrown with, median, what nine of ten stay below, largest [m]. */
export function tabulate({ trained, adapted }) {
  const row = (text, { median: middle, share90, largest }) => [text, middle, share90, largest];
  return [
    ...trained.map(({ trained_on: count, errors }) => row(`learned from ${count} throws`, errors)),
    ...adapted.map(({ real_throws: count, method, errors }) => row(`other world, ${count ? `${count} ${count === 1 ? "throw" : "throws"} there (${method})` : "not adapted"}`, errors)),
  ];
}

/**
 * @param {number[]} values
 * @returns {number | null} the one in the middle; null if there are none
 */
export function median(values) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[(sorted.length - 1) >> 1] ?? null;
}

function short(value) {
  return String(Number(value.toPrecision(3)));
}
