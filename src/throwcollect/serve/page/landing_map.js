/** The landing map: places where throws ended, seen from above; the robot stands at the origin, and its x points up in the picture. */

import { get, make, makeButton, setText } from "./dom.js";
import { Filter } from "./filter.js";
import { describeModel, drawModel } from "./model_map.js";
import { TARGET_COLOR, addSuccess, colorOf } from "./outcomes.js";
import { ThrowList } from "./throw_list.js";
import { THROWS, count, nameMap } from "./words.js";

const DOT_PX = 2.5;
const MARGIN_PX = 26;
/** Bodies are in the picture up to this distance [m], as they may be as large as a hall. */
const BODIES_M = 3;
/** Two lines of the grid are no closer than this. */
const CLOSEST_PX = 25;
/** A click this near to a landing means the landing. */
const NEAR_PX = 9;

const SHOWN = "of those that were shown";
const SO_FAR = "so far";
const ALL = "of all";

/** @typedef {import("./throw_list.js").Row} Row */

/** Draws landings into the canvas of the page. */
export class LandingMap {
  list = new ThrowList();
  /** @type {import("./words.js").Words} */
  words = THROWS;
  /** Called when throws or the filter have changed. */
  changed = () => {};
  /** Which landings the map shows, in words. */
  #which = SHOWN;
  /** @type {[number, number] | null} */
  #target = null;
  /** @type {import("./bodies.js").Body[]} */
  #bodies = [];
  /** @type {import("./throws.js").Throw | null} */
  #newest = null;
  /** @type {import("./throws.js").Throw | null} */
  #compared = null;
  /** @type {number[] | null} */
  #chosen = null;
  /** @type {import("./model_map.js").ModelOnMap | null} */
  #model = null;
  /** Grows with each change. */
  revision = 0;

  /**
   * @param {(x: number, y: number) => void} choose called with the place of each click on the ground [m], frame world
   * @param {(trial: number) => void} pick called with the trial of each landing that is clicked
   */
  constructor(choose, pick = () => {}) {
    this.canvas = get("map");
    this.filter = new Filter(() => this.refresh());
    this.canvas.addEventListener("click", ({ offsetX, offsetY, shiftKey }) => {
      const row = shiftKey ? null : this.#near(offsetX, offsetY);
      if (row) pick(row[3]);
      else choose(...this.#frame(this.canvas.clientWidth, this.canvas.clientHeight).from(offsetX, offsetY));
    });
    this.canvas.addEventListener("mousemove", ({ offsetX, offsetY }) => {
      const row = this.#near(offsetX, offsetY);
      this.canvas.style.cursor = row ? "pointer" : "";
      this.canvas.title = row ? `trial ${row[3]}, ${row[2]}: click to replay` : "";
    });
    new ResizeObserver(() => this.#draw()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#draw());
  }

  /** Forget all throws. */
  clear() {
    this.list = new ThrowList();
    this.#newest = this.#compared = null;
    this.#target = null;
    this.#bodies = [];
    this.#which = SHOWN;
    this.filter.offer([]);
    this.#use(THROWS);
    this.refresh();
  }

  /** @param {string} noun word for a trial of the run, whose words for places come with its first throws */
  name(noun) {
    if (noun !== this.words.noun) this.#use({ noun, end: "end" });
  }

  #use(words) {
    this.words = words;
    setText(get("map-title"), nameMap(words));
  }

  /** @param {{noun: string, end: string, success: string, values: Record<string, unknown>}} facts of the task whose throws these are */
  know({ noun, end, success, values }) {
    this.#use({ noun, end });
    addSuccess(success);
    this.filter.offer(Object.keys(values));
  }

  /**
   * @param {Row[]} rows throws of a finished dataset, evenly chosen
   * @param {number} total number of its throws with a place
   * @param {Record<string, number>} outcomes how many of its throws ended with each outcome
   */
  put(rows, total, outcomes) {
    this.#which = ALL;
    this.list = new ThrowList();
    this.list.add(rows);
    this.list.setTotals(total, outcomes);
    this.refresh();
  }

  /** @param {Row[]} rows throws of a dataset that grows; those that are known already are left out */
  addAll(rows) {
    this.#which = SO_FAR;
    this.list.add(rows);
    this.refresh();
  }

  /** Draw anew, because throws or the filter have changed. */
  refresh() {
    this.#tell();
    this.#draw();
    this.changed();
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
  add({ trial, outcome, landing, values }) {
    if (this.#which === ALL) return;
    this.list.add([[landing?.[0] ?? null, landing?.[1] ?? null, outcome, trial, values]]);
    this.refresh();
  }

  /**
   * @param {import("./throws.js").Throw | null} shown the throw to mark
   * @param {import("./throws.js").Throw | null} [compared] the throw that it is compared with
   */
  mark(shown, compared = null) {
    this.#newest = shown;
    this.#compared = compared;
    this.#draw();
  }

  get #placed() {
    return this.filter.isActive ? this.list.placed.filter(this.filter.accepts) : this.list.placed;
  }

  /** The landing that is drawn nearest to a place in the picture [px]; undefined if there is none. */
  #near(x, y) {
    const { at } = this.#frame(this.canvas.clientWidth, this.canvas.clientHeight);
    let [nearest, least] = [undefined, NEAR_PX];
    for (const row of this.#placed) {
      const [right, down] = at(row[0], row[1]);
      const away = Math.hypot(right - x, down - y);
      if (away <= least) [nearest, least] = [row, away];
    }
    return nearest;
  }

  #tell() {
    const { list, words: { noun, end }, filter } = this;
    const focused = document.activeElement?.dataset?.outcome;
    const items = [...list.outcomes].sort(([, a], [, b]) => b - a).map(([outcome, number]) => this.#makeToggle(outcome, number));
    get("legend").replaceChildren(...items.map(({ item }) => item));
    items.find(({ button }) => focused && button.dataset.outcome === focused)?.button.focus();
    const placed = this.#placed;
    if (!placed.length) {
      setText(get("map-text"), filter.isActive && list.placed.length ? `No ${end} passes the filter.` : describeNothing(this.words, list.outcomes.size));
      return;
    }
    const [x0, x1] = range(placed.map(([x]) => x));
    const [y0, y1] = range(placed.map(([, y]) => y));
    const number = filter.isActive || list.total > placed.length ? `${placed.length} of ${count(list.total, end)}` : count(placed.length, end);
    const text = `${number} ${this.#which === SO_FAR ? SO_FAR : `${this.#which}${this.#which === ALL ? ` ${noun}s` : ""}`}: `
      + `${x0.toFixed(2)} to ${x1.toFixed(2)} m before the robot, `
      + `${y0.toFixed(2)} to ${y1.toFixed(2)} m to its left.${this.#target ? " Aimed at: between the arcs." : ""}`;
    setText(get("map-text"), text);
  }

  #makeToggle(outcome, number) {
    const isShown = !this.filter.hidden.has(outcome);
    const button = makeButton("", () => this.filter.toggle(outcome), { className: "outcome", "aria-pressed": isShown, title: isShown ? `leave ${outcome} out` : `show ${outcome} again` });
    button.dataset.outcome = outcome;
    button.append(makeDot(outcome), `${outcome} ${number}`);
    return { button, item: make("li", {}, button) };
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
    const places = [...this.list.placed, ...(this.#model?.reached ?? []), ...corners];
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
    const placed = this.#placed;
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
    if (this.#compared?.landing) drawRing(pen, at, this.#compared.landing, style.getPropertyValue("--muted"));
    if (this.#newest?.landing) drawRing(pen, at, this.#newest.landing, style.color);
    if (this.#chosen) drawChosen(pen, at(this.#chosen[0], this.#chosen[1]));
    return { centre, scale };
  }
}

/**
 * @param {string} outcome
 * @param {number} number
 * @returns {HTMLElement} an item of a legend
 */
export function legendItem(outcome, number) {
  return make("li", {}, makeDot(outcome), `${outcome} ${number}`);
}

function makeDot(outcome) {
  const dot = make("span", { className: "dot", "aria-hidden": "true" });
  dot.style.background = colorOf(outcome);
  return dot;
}

function describeNothing({ noun, end }, ended) {
  if (end === "landing") return ended ? `None of these ${noun}s has landed.` : "Nothing has landed yet.";
  return ended ? `None of these ${noun}s has a ${end}.` : `No ${end} yet.`;
}

function drawRing(pen, at, [x, y], color) {
  pen.strokeStyle = color;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.arc(...at(x, y), 3 * DOT_PX, 0, 7);
  pen.stroke();
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
