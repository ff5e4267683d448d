/** Places for panels on the stage, so that none covers another. */

export const EDGE_PX = 4;

/** @typedef {{left: number, top: number, width: number, height: number}} Box */

/**
 * The free place that is nearest to the wanted place of a panel; null if none is free. The first panel gets its place.
 * @param {Box} box the wanted place [px]
 * @param {Box[]} taken where others are
 * @param {{most: number, lowest: number}} stage largest left and largest top that the panel may have
 * @returns {{left: number, top: number} | null}
 */
export function placeApart(box, taken, { most, lowest }) {
  const { left, top, width, height } = box;
  // If the stage is smaller than a panel, it shows the part of the panel that fits.
  if (!taken.length) return { left, top };
  const lefts = [left, ...taken.flatMap((each) => [each.left + each.width + EDGE_PX, each.left - width - EDGE_PX])];
  const tops = [top, ...taken.flatMap((each) => [each.top + each.height + EDGE_PX, each.top - height - EDGE_PX])];
  const isFree = (x, y) => x >= 0 && y >= 0 && x <= most && y <= lowest && !taken.some((each) => (
    x < each.left + each.width && each.left < x + width && y < each.top + each.height && each.top < y + height));
  const free = lefts.flatMap((x) => tops.map((y) => ({ left: x, top: y }))).filter((at) => isFree(at.left, at.top));
  const away = (at) => Math.hypot(at.left - left, at.top - top);
  return free.reduce((best, at) => (best && away(best) <= away(at) ? best : at), null);
}
