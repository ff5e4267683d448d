/** Colours of outcomes: those of the table `STYLES` in Python, which reports, pictures and viewers have, too. */

/** Colour of the target. */
export const TARGET_COLOR = "#d6246e";

const COLORS = {
  landed: "#0072B2",
  limit_violated: "#E69F00",
  self_hit: "#D55E00",
  recaught: "#CC79A7",
  not_released: "#56B4E9",
  dropped: "#8A63D2",
  body_hit: "#44AA99",
  wall_hit: "#AA4499",
  rim_hit: "#00A2B3",
  bounced_out: "#CC6677",
  short: "#C4B04A",
  beyond: "#117733",
  missed_puck: "#56B4E9",
  pushed_twice: "#CC79A7",
  off_table: "#8A63D2",
  robot_hit: "#D55E00",
  timeout: "#009E73",
  tracking_failed: "#999933",
  lost: "#7F7F7F",
  refused: "#B3B3B3",
};
const OTHERS = ["#882255", "#A0522D", "#4A90D9", "#B04AC0", "#7F9C1F", "#1F9E77"];

/** Outcomes that are a success of their task, as far as the page has heard of them. */
const successes = new Set(["landed"]);

/** @param {string} outcome is the success of a task, so it has the colour of a landing from now on */
export function addSuccess(outcome) {
  successes.add(outcome);
}

/**
 * @param {string} outcome
 * @returns {string} its colour, always the same
 */
export function colorOf(outcome) {
  if (successes.has(outcome)) return COLORS.landed;
  if (Object.hasOwn(COLORS, outcome)) return COLORS[outcome];
  const sum = [...outcome].reduce((all, letter) => all + letter.codePointAt(0), 0);
  return OTHERS[sum % OTHERS.length];
}
