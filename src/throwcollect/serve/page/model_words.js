/** Describes a model in words. */

/** For a unit of targets: the factor and the unit with which misses are shown, and the noun for a miss. */
const SHOWN_AS = { m: [100, "cm", "Distance"], rad: [180 / Math.PI, "°", "Angle"] };

/** @typedef {{unit: string, median: number | null, share90: number | null, largest: number | null}} Misses */

/**
 * @param {string} unit of targets
 * @returns {[number, string, string]} the factor and the unit with which misses are shown, and the noun for a miss
 */
export function readAs(unit) {
  return SHOWN_AS[unit] ?? [1, unit, "Difference"];
}

/**
 * @param {Misses & {others: Misses[]}} errors
 * @returns {Misses[]} misses over the targets of each unit
 */
export function byUnit(errors) {
  return [errors, ...errors.others];
}

/**
 * @param {number | null} miss
 * @param {string} unit
 * @returns {string}
 */
function tellMiss(miss, unit) {
  if (miss === null) return "–";
  const [factor, shown] = readAs(unit);
  const number = unit in SHOWN_AS ? (miss * factor).toFixed(2) : short(miss);
  return shown === "°" ? number + shown : `${number} ${shown}`.trim();
}

/**
 * @param {number | null} length over all targets
 * @param {string[]} targets whose names end with their units
 * @returns {string} one of several units has no name
 */
function tellLength(length, targets) {
  const units = [...new Set(targets.map((each) => each.slice(each.lastIndexOf("_") + 1)))];
  if (length === null || (units.length === 1 && units[0] in SHOWN_AS)) return tellMiss(length, units[0]);
  return units.length === 1 ? short(length) : `${short(length)} (over targets of several units)`;
}

/**
 * Describe a model in sentences.
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
  texts.push(score ? `All misses below are those of throws in simulation, at ${score.targets} targets${score.seeds > 1 ? ` of each of ${score.seeds} seeds` : ""}.` : "Nobody has thrown with it yet; throwcollect score does, in simulation.");
  return texts.join(" ");
}

/** Rows of the table of errors: the model that threw, the median, what nine of ten stay below, and the largest. */
export function tabulate({ trained, distilled, adapted }) {
  // A line may be broken only between two units.
  const tell = (errors, name) => [...new Set(byUnit(errors).map((each) => tellMiss(each[name], each.unit).replaceAll(" ", "\u00a0")))].join(", ");
  const row = (text, errors) => [text, ...["median", "share90", "largest"].map((name) => tell(errors, name))];
  return [
    ...trained.map(({ trained_on: count, errors }) => row(`learned from ${count} throws`, errors)),
    ...(distilled ? [row("model.onnx of these", distilled)] : []),
    ...adapted.map(({ real_throws: count, method, errors }) => row(`other world, ${count ? `${count} ${count === 1 ? "throw" : "throws"} there (${method})` : "not adapted"}`, errors)),
  ];
}

/**
 * @param {number[]} values
 * @returns {number | null} the one in the middle, or the mean of the two there; null if there are none
 */
export function median(values) {
  if (!values.length) return null;
  const sorted = [...values].sort((a, b) => a - b);
  return (sorted[(sorted.length - 1) >> 1] + sorted[sorted.length >> 1]) / 2;
}

function short(value) {
  return String(Number(value.toPrecision(3)));
}
