/** Colours of outcomes, which differ in the dark, in the light, and for most users who are colour-blind. */

/** Colour of the target. */
export const TARGET_COLOR = "#d6246e";

const COLORS = {
  landed: "#1f9e77",
  in_bin: "#1f9e77",
  at_rest: "#1f9e77",
  dropped: "#d95f02",
  not_released: "#7570b3",
  recaught: "#e7298a",
  self_hit: "#c5352f",
  limit_violated: "#b8860b",
  body_hit: "#7f9c1f",
  wall_hit: "#b04ac0",
  rim_hit: "#00a2b3",
  bounced_out: "#ff8f6b",
  short: "#d4b106",
  beyond: "#6a4fd0",
  missed_puck: "#d95f02",
  pushed_twice: "#e7298a",
  off_table: "#7570b3",
  robot_hit: "#c5352f",
  timeout: "#4a90d9",
  tracking_failed: "#a0522d",
  lost: "#808080",
};
const OTHERS = ["#1f9e77", "#4a90d9", "#d95f02", "#7570b3", "#e7298a", "#b8860b"];

/**
 * @param {string} outcome
 * @returns {string} its colour, always the same
 */
export function colorOf(outcome) {
  if (Object.hasOwn(COLORS, outcome)) return COLORS[outcome];
  const sum = [...outcome].reduce((all, letter) => all + letter.charCodeAt(0), 0);
  return OTHERS[sum % OTHERS.length];
}
