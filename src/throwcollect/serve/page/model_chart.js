/** A small chart of distances from targets over a number of throws; the table beside it says the same. */

import uPlot from "./vendor/uplot/dist/uPlot.esm.js";
import { make } from "./dom.js";
import { byUnit, readAs } from "./model_words.js";

const HEIGHT_PX = 130;

/**
 * Draw the median, and the distance that nine of ten throws stay below, in a chart for each unit of the targets.
 * @param {Element} place that it is put into
 * @param {string} title of the numbers of throws
 * @param {[number, import("./model_words.js").Misses & {others: import("./model_words.js").Misses[]}][]} errors by number of throws
 * @param {{isLogarithmic: boolean}} options whether both axes are
 */
export function drawErrors(place, title, errors, options) {
  if (!errors.length) return;
  byUnit(errors[0][1]).forEach(({ unit }, i) => drawMisses(place, title, unit, errors.map(([count, each]) => [count, byUnit(each)[i]]), options));
}

function drawMisses(place, title, unit, errors, { isLogarithmic }) {
  const [factor, shown, noun] = readAs(unit);
  const box = make("figure", { className: "model-chart" }, make("figcaption", {}, `${noun} from the target [${shown}] over ${title}`));
  box.setAttribute("aria-hidden", "true");
  place.append(box);
  const style = getComputedStyle(place);
  const distr = isLogarithmic ? 3 : 1;
  const axis = { stroke: style.color, grid: { stroke: style.getPropertyValue("--grid"), width: 1 }, ticks: { show: false }, font: "11px system-ui, sans-serif" };
  const line = { stroke: style.getPropertyValue("--accent"), width: 2, points: { show: true, size: 5 } };
  const data = [
    errors.map(([count]) => count),
    errors.map(([, { median }]) => scale(median, factor)),
    errors.map(([, { share90 }]) => scale(share90, factor)),
  ];
  new uPlot({
    width: place.clientWidth,
    height: HEIGHT_PX,
    cursor: { show: false },
    legend: { show: false },
    scales: { x: { time: false, distr }, y: { distr, ...(isLogarithmic ? {} : { range: (_, __, most) => [0, most * 1.1] }) } },
    axes: [{ ...axis, size: 24 }, { ...axis, size: 44 }],
    series: [{}, line, { ...line, dash: [5, 4] }],
  }, data, box);
}

function scale(length, factor) {
  return length === null ? null : length * factor;
}
