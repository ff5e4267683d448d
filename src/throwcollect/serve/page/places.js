/** Places for panels on the stage, so that none covers another. */

export const EDGE_PX = 4;

/** @typedef {{left: number, top: number, width: number, height: number}} Box */

/**
 * The free place that is nearest to where a panel wants to be; null if none is free. The first panel gets what it wants.
 * @param {Box} box where it wants to be [px]
 * @param {Box[]} taken where others are
 * @param {{most: number, lowest: number}} stage up to where its left and its top may be
 * @returns {{left: number, top: number} | null}
 */
export function placeApart(box, taken, { most, lowest }) {
  const { left, top, width, height } = box;
  // A stage that is smaller than a panel shows as much of it as there is.
  if (!taken.length) return { left, top };
  const lefts = [left, ...taken.flatMap((each) => [each.left + each.width + EDGE_PX, each.left - width - EDGE_PX])];
  const tops = [top, ...taken.flatMap((each) => [each.top + each.height + EDGE_PX, each.top - height - EDGE_PX])];
  const isFree = (x, y) => x >= 0 && y >= 0 && x <= most && y <= lowest && !taken.some((each) => (
    x < each.left + each.width && each.left < x + width && y < each.top + each.height && each.top < y + height));
  const free = lefts.flatMap((x) => tops.map((y) => ({ left: x, top: y }))).filter((at) => isFree(at.left, at.top));
  const away = (at) => Math.hypot(at.left - left, at.top - top);
  return free.reduce((best, at) => (best && away(best) <= away(at) ? best : at), null);
}
