/** The landing map: landings seen from above; the robot stands at the origin, and its x points up in the picture. */

import { get, make, setText } from "./dom.js";
import { describeModel, drawModel } from "./model_map.js";
import { TARGET_COLOR, colorOf } from "./outcomes.js";

const DOT_PX = 2.5;
const MARGIN_PX = 26;
/** Bodies are in the picture up to this distance [m], as they may be as large as a hall. */
const BODIES_M = 3;
/** Two lines of the grid are no closer than this. */
const CLOSEST_PX = 25;
/** Most landings that are drawn. If there are more, every second one is dropped, now and of all later landings. */
const MOST = 20000;

const SHOWN = "of throws that were shown";
const SO_FAR = "so far";
const ALL = "of all throws";

/** @typedef {[number | null, number | null, string, number]} Landing x, y [m], outcome, trial */

/** Draws landings into the canvas of the page. */
export class LandingMap {
  /** @type {Landing[]} the landings that are drawn; each has a place */
  #landings = [];
  #trials = new Set();
  /** @type {Map<string, number>} how many throws ended with each outcome, drawn or not */
  #outcomes = new Map();
  /** One of this many landings is drawn. */
  #stride = 1;
  /** Which landings the map shows, in words. */
  #which = SHOWN;
  /** Number of all landings, from which the drawn ones are evenly chosen. */
  #total = 0;
  /** @type {[number, number] | null} */
  #target = null;
  /** @type {import("./bodies.js").Body[]} */
  #bodies = [];
  /** @type {import("./throws.js").Throw | null} */
  #newest = null;
  /** @type {number[] | null} */
  #chosen = null;
  /** @type {import("./model_map.js").ModelOnMap | null} */
  #model = null;
  /** Grows with each change. */
  revision = 0;

  /** @param {(x: number, y: number) => void} choose called with the place of each click on the ground [m], frame world */
  constructor(choose) {
    this.canvas = get("map");
    this.canvas.addEventListener("click", ({ offsetX, offsetY }) => choose(...this.#frame(this.canvas.clientWidth, this.canvas.clientHeight).from(offsetX, offsetY)));
    new ResizeObserver(() => this.#draw()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#draw());
  }

  /** Forget all landings. */
  clear() {
    this.#trials.clear();
    this.#newest = null;
    this.#target = null;
    this.#bodies = [];
    this.put([], 0, {});
    this.#which = SHOWN;
  }

  /**
   * @param {Landing[]} landings of a finished dataset, evenly chosen
   * @param {number} total number of its landings
   * @param {Record<string, number>} outcomes how many of its throws ended with each outcome
   */
  put(landings, total, outcomes) {
    this.#total = total;
    this.#stride = 1;
    this.#which = ALL;
    this.#landings = landings.filter(isPlaced);
    this.#outcomes = new Map(Object.entries(outcomes));
    this.#tell();
    this.#draw();
  }

  /** @param {Landing[]} landings of a dataset that grows; those that are known already are left out */
  addAll(landings) {
    this.#which = SO_FAR;
    for (const landing of landings) this.#push(landing);
    this.#tell();
    this.#draw();
  }

  /** @param {[number, number] | null} distances between which throws are to land [m] */
  aim(distances) {
    this.#target = distances;
    this.#tell();
    this.#draw();
  }

  /** @param {import("./bodies.js").Body[]} bodies that are drawn, until a throw that is marked has others */
  surround(bodies) {
    this.#bodies = bodies;
    this.#draw();
  }

  get #outlines() {
    // The ball begins in the tool, wherever that is.
    const bodies = (this.#newest?.bodies ?? this.#bodies).filter(({ name }) => name !== "ball");
    return bodies.map(({ above_m, color }) => ({ corners: above_m, color }));
  }

  /** @param {number[] | null} place of the target [m], frame world; null if there is none */
  choose(place) {
    this.#chosen = place;
    this.#draw();
  }

  /** @param {import("./model_map.js").ModelOnMap | null} model that is drawn below the landings; null for none */
  showModel(model) {
    this.#model = model;
    setText(get("map-model"), describeModel(model));
    this.#draw();
  }

  /** @param {import("./throws.js").Throw} shown a new throw of a run that is collecting */
  add({ trial, outcome, landing }) {
    if (this.#which === ALL) return;
    this.#push([landing?.[0] ?? null, landing?.[1] ?? null, outcome, trial]);
    this.#tell();
    this.#draw();
  }

  #push(landing) {
    const [, , outcome, trial] = landing;
    if (this.#trials.has(trial)) return;
    this.#trials.add(trial);
    this.#outcomes.set(outcome, (this.#outcomes.get(outcome) ?? 0) + 1);
    if (!isPlaced(landing)) return;
    this.#total += 1;
    if ((this.#total - 1) % this.#stride) return;
    this.#landings.push(landing);
    if (this.#landings.length <= MOST) return;
    this.#landings = this.#landings.filter((_, i) => i % 2 === 0);
    this.#stride *= 2;
  }

  /** @param {import("./throws.js").Throw | null} shown the throw to mark */
  mark(shown) {
    this.#newest = shown;
    this.#draw();
  }

  #tell() {
    const items = [...this.#outcomes].sort(([, a], [, b]) => b - a).map(([outcome, count]) => legendItem(outcome, count));
    get("legend").replaceChildren(...items);
    const placed = this.#landings;
    if (!placed.length) {
      setText(get("map-text"), this.#outcomes.size ? "None of these throws has landed." : "Nothing has landed yet.");
      return;
    }
    const [x0, x1] = range(placed.map(([x]) => x));
    const [y0, y1] = range(placed.map(([, y]) => y));
    const count = this.#total > placed.length ? `${placed.length} of ${this.#total}` : placed.length;
    const text = `${count} landings ${this.#which}: ${x0.toFixed(2)} to ${x1.toFixed(2)} m before the robot, `
      + `${y0.toFixed(2)} to ${y1.toFixed(2)} m to its left.${this.#target ? " Aimed at: between the arcs." : ""}`;
    setText(get("map-text"), text);
  }

  #draw() {
    this.revision += 1;
    const { canvas } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (width && height) this.paint(canvas, width, height, Math.min(devicePixelRatio, 2));
  }

  /** Scale and conversions between places on the ground and in a picture, in which x points up and y to the left. */
  #frame(width, height) {
    const [chosenX, chosenY] = this.#chosen ?? [0, 0];
    // The robot is always in the picture.
    const near = (value) => Math.min(Math.max(value, -BODIES_M), BODIES_M);
    const corners = this.#outlines.flatMap((each) => each.corners.map((corner) => corner.map(near)));
    const places = [...this.#landings, ...(this.#model?.reached ?? []), ...corners];
    const [x0, x1] = range([...places.map(([x]) => x), -0.2, 1, this.#target?.[1] ?? 1, chosenX]);
    const [y0, y1] = range([...places.map(([, y]) => y), -0.5, 0.5, chosenY]);
    const scale = Math.min((width - 2 * MARGIN_PX) / (y1 - y0), (height - 2 * MARGIN_PX) / (x1 - x0));
    const [x, y] = [(x0 + x1) / 2, (y0 + y1) / 2];
    return {
      scale,
      centre: [x, y],
      at: (atX, atY) => [width / 2 - (atY - y) * scale, height / 2 - (atX - x) * scale],
      from: (right, down) => [x - (down - height / 2) / scale, y - (right - width / 2) / scale],
    };
  }

  /**
   * Draw the map into a canvas.
   * @param {HTMLCanvasElement} canvas
   * @param {number} width of the picture
   * @param {number} height
   * @param {number} ratio pixels of the canvas for each of the picture
   * @returns {{centre: number[], scale: number}} place in the middle [m], and units of the picture for each metre
   */
  paint(canvas, width, height, ratio) {
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const style = getComputedStyle(this.canvas);
    const placed = this.#landings;
    const { at, scale, centre } = this.#frame(width, height);
    drawGrid(pen, style, at, scale, { width, height });
    for (const outline of this.#outlines) drawOutline(pen, at, outline);
    drawRobot(pen, style, at, scale);
    if (this.#model) drawModel(pen, style, at, this.#model);
    if (this.#target) drawTarget(pen, style, at, scale, this.#target);
    pen.globalAlpha = placed.length > 500 ? 0.5 : 0.85;
    for (const [x, y, outcome] of placed) {
      pen.fillStyle = colorOf(outcome);
      pen.beginPath();
      pen.arc(...at(x, y), DOT_PX, 0, 7);
      pen.fill();
    }
    pen.globalAlpha = 1;
    if (this.#newest?.landing) {
      pen.strokeStyle = style.color;
      pen.lineWidth = 2;
      pen.beginPath();
      pen.arc(...at(this.#newest.landing[0], this.#newest.landing[1]), 3 * DOT_PX, 0, 7);
      pen.stroke();
    }
    if (this.#chosen) drawChosen(pen, at(this.#chosen[0], this.#chosen[1]));
    return { centre, scale };
  }
}

/**
 * @param {string} outcome
 * @param {number} count
 * @returns {HTMLElement} an item of a legend
 */
export function legendItem(outcome, count) {
  const dot = make("span", { className: "dot", "aria-hidden": "true" });
  dot.style.background = colorOf(outcome);
  return make("li", {}, dot, `${outcome} ${count}`);
}

function isPlaced([x, y]) {
  return Number.isFinite(x) && Number.isFinite(y);
}

function range(values) {
  return values.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
}

/** Distance of lines that are not too close to each other [m]. */
function chooseStep(scale) {
  if (scale > 5) return scale > 200 ? 0.2 : scale > 70 ? 0.5 : scale > 25 ? 1 : 5;
  return 10 ** Math.ceil(Math.log10(CLOSEST_PX / scale));
}

function drawGrid(pen, style, at, scale, { width, height }) {
  const step = chooseStep(scale);
  const [left, bottom] = at(0, 0);
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = style.getPropertyValue("--muted");
  pen.strokeStyle = style.getPropertyValue("--grid");
  pen.lineWidth = 1;
  const lines = (length, origin, draw) => {
    for (let i = Math.ceil(-origin / (step * scale)); origin + i * step * scale < length; i++) draw(i * step, origin + i * step * scale);
  };
  lines(width, left, (value, x) => {
    stroke(pen, [x, 0], [x, height]);
    const text = (-value).toFixed(1);
    // At the edge there may be no room for the number.
    if (x + 3 + pen.measureText(text).width <= width) pen.fillText(text, x + 3, height - 4);
  });
  lines(height, bottom, (value, y) => {
    stroke(pen, [0, y], [width, y]);
    // The other axis has its numbers at the bottom.
    if (y < height - 14) pen.fillText(`${(-value).toFixed(1)} m`, 3, y - 3);
  });
}

function stroke(pen, from, to) {
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...to);
  pen.stroke();
}

function drawOutline(pen, at, { corners, color }) {
  pen.beginPath();
  for (const corner of corners) pen.lineTo(...at(...corner));
  pen.closePath();
  pen.fillStyle = pen.strokeStyle = color;
  pen.lineWidth = 1;
  pen.globalAlpha = 0.2;
  pen.fill();
  pen.globalAlpha = 1;
  pen.stroke();
}

function drawTarget(pen, style, at, scale, distances) {
  const [x, y] = at(0, 0);
  pen.strokeStyle = style.getPropertyValue("--muted");
  pen.lineWidth = 1.5;
  pen.setLineDash([4, 4]);
  for (const distance of distances) {
    pen.beginPath();
    pen.arc(x, y, distance * scale, Math.PI, 2 * Math.PI);
    pen.stroke();
  }
  pen.setLineDash([]);
}

function drawChosen(pen, [x, y]) {
  pen.strokeStyle = TARGET_COLOR;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.arc(x, y, 2.5 * DOT_PX, 0, 7);
  pen.stroke();
  stroke(pen, [x - 5 * DOT_PX, y], [x + 5 * DOT_PX, y]);
  stroke(pen, [x, y - 5 * DOT_PX], [x, y + 5 * DOT_PX]);
}

function drawRobot(pen, style, at, scale) {
  const [x, y] = at(0, 0);
  for (const [radius, color] of [[0.16, style.getPropertyValue("--muted")], [0.08, style.color]]) {
    pen.fillStyle = color;
    pen.beginPath();
    pen.arc(x, y, radius * scale, 0, 7);
    pen.fill();
  }
}
