/** Draws a model into the landing map: where its throws came down, targets, and misses. */

import { TARGET_COLOR } from "./outcomes.js";

/** Factor by which misses are drawn longer than they are. */
const ARROWS = 10;
const ARM_PX = 3.5;

/** @typedef {{name: string, reached: number[][], throws: {target: number[], place: number[] | null}[]}} ModelOnMap */

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {CSSStyleDeclaration} style of the canvas
 * @param {(x: number, y: number) => number[]} at where a place lies in the picture
 * @param {ModelOnMap} model
 */
export function drawModel(pen, style, at, { reached, throws }) {
  pen.fillStyle = style.getPropertyValue("--muted");
  pen.globalAlpha = 0.35;
  for (const [x, y] of reached) {
    const [right, down] = at(x, y);
    pen.fillRect(right - 1, down - 1, 2, 2);
  }
  pen.globalAlpha = 1;
  pen.lineWidth = 1.5;
  for (const { target: [x, y], place } of throws) {
    const [right, down] = at(x, y);
    pen.strokeStyle = place ? style.color : TARGET_COLOR;
    pen.beginPath();
    pen.moveTo(right - ARM_PX, down);
    pen.lineTo(right + ARM_PX, down);
    pen.moveTo(right, down - ARM_PX);
    pen.lineTo(right, down + ARM_PX);
    pen.stroke();
    if (!place) continue;
    pen.strokeStyle = style.getPropertyValue("--accent");
    pen.beginPath();
    pen.moveTo(right, down);
    pen.lineTo(...at(x + ARROWS * (place[0] - x), y + ARROWS * (place[1] - y)));
    pen.stroke();
  }
}

/**
 * @param {ModelOnMap | null} model
 * @returns {string} a description of the drawing; empty without a model
 */
export function describeModel(model) {
  if (model === null) return "";
  const { name, reached, throws } = model;
  const missed = throws.filter(({ place }) => !place).length;
  const texts = [`Grey: ${reached.length} of the throws that ${name} was learned from.`];
  if (throws.length) texts.push(`Crosses: ${throws.length} targets, with misses drawn ${ARROWS} times as long${missed ? `; at ${missed} of them no throw landed` : ""}.`);
  return texts.join(" ");
}
