/** Boards that stand in a room, where the page cannot be seen: the state of a run, plots, and the landing map. */

import {
  BufferGeometry, CanvasTexture, Line, LineBasicMaterial, Mesh, MeshBasicMaterial, PlaneGeometry, SRGBColorSpace, Vector3,
} from "./vendor/three/build/three.module.js";
import { colorOf } from "./outcomes.js";

const FONT = "system-ui, sans-serif";
const EDGE = 32;
const LINE = 46;
const BUTTON_HEIGHT = 84;

function color(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** A picture in the room, which is turned to the user. */
class Board {
  #canvas = document.createElement("canvas");
  #drawn = "";

  /**
   * @param {number} widthM [m]
   * @param {number} width of the picture
   * @param {number} height
   */
  constructor(widthM, width, height) {
    Object.assign(this.#canvas, { width, height });
    this.texture = new CanvasTexture(this.#canvas);
    this.texture.colorSpace = SRGBColorSpace;
    const material = new MeshBasicMaterial({ map: this.texture, transparent: true });
    this.mesh = new Mesh(new PlaneGeometry(widthM, (widthM * height) / width), material);
    this.mesh.userData.board = this;
  }

  /**
   * Put it somewhere.
   * @param {Vector3} place in the room [m]
   * @param {Vector3} eye of the user, in the room [m]
   */
  stand(place, eye) {
    this.mesh.position.copy(place);
    this.mesh.lookAt(eye.x, place.y, eye.z);
  }

  /**
   * Draw again, if anything is new.
   * @param {unknown} facts what is drawn
   * @param {(pen: CanvasRenderingContext2D, width: number, height: number) => void} draw
   */
  renew(facts, draw) {
    const now = JSON.stringify(facts);
    if (now === this.#drawn) return;
    this.#drawn = now;
    const { width, height } = this.#canvas;
    const pen = this.#canvas.getContext("2d");
    pen.clearRect(0, 0, width, height);
    draw(pen, width, height);
    this.texture.needsUpdate = true;
  }

  dispose() {
    this.mesh.removeFromParent();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
    this.texture.dispose();
  }
}

/**
 * @typedef {object} Facts
 * @property {string} title
 * @property {[number, number] | null} progress steps done, and all
 * @property {Record<string, number>} outcomes
 * @property {string[]} lines
 */

/** A board with the state of a run, and with buttons. */
export class InfoBoard extends Board {
  /** @param {{text: string, isOffered: () => boolean, act: () => void}[]} buttons */
  constructor(buttons) {
    super(1, 1024, 680);
    this.buttons = buttons;
  }

  /**
   * @param {Facts} facts
   * @param {number | null} pointed number of the button that somebody points at
   */
  show(facts, pointed) {
    const offered = this.buttons.map(({ isOffered }) => isOffered());
    this.renew([facts, offered, pointed], (pen, width, height) => {
      drawCard(pen, width, height);
      pen.fillStyle = color("text");
      pen.font = `600 44px ${FONT}`;
      pen.fillText(facts.title, EDGE, EDGE + 40, width - 2 * EDGE);
      let y = EDGE + 80;
      if (facts.progress) {
        drawProgress(pen, y, width, facts.progress);
        y += LINE + 30;
      }
      y = drawOutcomes(pen, y, width, facts.outcomes);
      pen.font = `34px ${FONT}`;
      pen.fillStyle = color("text");
      for (const line of facts.lines.flatMap((text) => wrap(pen, text, width - 2 * EDGE))) {
        y += LINE;
        if (y < height - BUTTON_HEIGHT - EDGE) pen.fillText(line, EDGE, y);
      }
      this.buttons.forEach(({ text }, i) => {
        pen.globalAlpha = offered[i] ? 1 : 0.4;
        this.#drawButton(pen, width, height, i, text, i === pointed && offered[i]);
      });
      pen.globalAlpha = 1;
    });
  }

  /**
   * @param {{x: number, y: number}} uv
   * @returns {number | null} number of the button that is there
   */
  buttonAt({ x, y }) {
    return y * 680 < BUTTON_HEIGHT + EDGE / 2 ? Math.min(Math.floor(x * this.buttons.length), this.buttons.length - 1) : null;
  }

  /**
   * Press the button at a place.
   * @param {{x: number, y: number}} uv place as shares of width and height, from the lower left corner
   */
  press(uv) {
    const button = this.buttonAt(uv);
    if (button !== null && this.buttons[button].isOffered()) this.buttons[button].act();
  }

  #drawButton(pen, width, height, i, text, isPointed) {
    const each = (width - 2 * EDGE) / this.buttons.length;
    pen.fillStyle = isPointed ? color("accent") : color("back");
    pen.strokeStyle = color("accent");
    pen.lineWidth = 3;
    pen.beginPath();
    pen.roundRect(EDGE + i * each + 6, height - BUTTON_HEIGHT - EDGE / 2, each - 12, BUTTON_HEIGHT, 14);
    pen.fill();
    pen.stroke();
    pen.fillStyle = isPointed ? color("card") : color("text");
    pen.font = `34px ${FONT}`;
    pen.textAlign = "center";
    pen.fillText(text, EDGE + (i + 0.5) * each, height - BUTTON_HEIGHT / 2 - EDGE / 2 + 12, each - 30);
    pen.textAlign = "left";
  }
}

/** A board with a line to what it shows. */
class LedBoard extends Board {
  leader = new Line(new BufferGeometry().setFromPoints([new Vector3(), new Vector3()]), new LineBasicMaterial({ color: color("accent") }));

  constructor(...size) {
    super(...size);
    this.leader.frustumCulled = false;
  }

  /**
   * Draw the line to a place.
   * @param {Vector3 | null} place in the room [m]; null if there is none
   */
  lead(place) {
    this.leader.visible = place !== null;
    if (place) this.leader.geometry.setFromPoints([this.mesh.position, place]);
  }

  dispose() {
    super.dispose();
    this.leader.removeFromParent();
    this.leader.geometry.dispose();
    this.leader.material.dispose();
  }
}

/** A plot of the page, beside the link that it is bound to. */
export class PlotBoard extends LedBoard {
  /** @param {import("./plot_panel.js").PlotPanel} panel */
  constructor(panel) {
    // A plot that follows no link is wide, as it is on the page.
    super(panel.follows ? 0.5 : 1, panel.follows ? 512 : 1024, panel.follows ? 320 : 260);
    this.panel = panel;
  }

  show() {
    const { title, now, canvas, at } = this.panel.picture;
    this.renew([title, now, canvas === null, at && Math.round(at)], (pen, width, height) => {
      drawCard(pen, width, canvas ? height : 104);
      pen.fillStyle = color("text");
      pen.font = `600 26px ${FONT}`;
      pen.fillText(title, 16, 38, width - 32);
      pen.font = `30px ${FONT}`;
      pen.fillText(now, 16, 80);
      if (!canvas) return;
      const ratio = Math.min((width - 16) / canvas.width, (height - 104) / canvas.height);
      pen.drawImage(canvas, 8, 96, canvas.width * ratio, canvas.height * ratio);
      if (at === null) return;
      pen.fillRect(8 + at * ratio, 96, 2, canvas.height * ratio * 0.8);
    });
  }

  /** Show only the head of the plot, or all of it again. */
  press() {
    this.panel.collapse();
  }
}

/** A picture of a sensor, above it. */
export class PictureBoard extends LedBoard {
  /** @param {import("./sensor_strip.js").Strand} strand */
  constructor(strand) {
    super(0.36, 360, 300);
    this.strand = strand;
  }

  show() {
    const { canvas, drawn, key } = this.strand;
    this.renew(drawn, (pen, width, height) => {
      drawCard(pen, width, height);
      pen.fillStyle = color("text");
      pen.font = `600 22px ${FONT}`;
      pen.fillText(key.replace("/", ": "), 16, 30, width - 32);
      const ratio = Math.min((width - 16) / canvas.width, (height - 48) / canvas.height);
      pen.imageSmoothingEnabled = false;
      pen.drawImage(canvas, (width - canvas.width * ratio) / 2, 40, canvas.width * ratio, canvas.height * ratio);
    });
  }

  /** It has nothing to press, but sets no target either. */
  press() {}
}

/** The landing map, lying on the ground in its own size. */
export class MapBoard extends Board {
  static #SIZE = 1024;
  static #UNITS = 420;
  #revision = -1;

  /** @param {import("./landing_map.js").LandingMap} map */
  constructor(map) {
    super(1, MapBoard.#SIZE, MapBoard.#SIZE);
    this.map = map;
    this.mesh.material.depthWrite = false;
    // World's x points up in the map, and its y to the left.
    this.mesh.rotation.z = -Math.PI / 2;
  }

  show() {
    if (this.map.revision === this.#revision) return;
    this.#revision = this.map.revision;
    const units = MapBoard.#UNITS;
    const { centre, scale } = this.map.paint(this.texture.image, units, units, MapBoard.#SIZE / units);
    this.mesh.position.set(...centre, 0.004);
    this.mesh.scale.setScalar(units / scale);
    this.texture.needsUpdate = true;
  }
}

function drawCard(pen, width, height) {
  pen.fillStyle = color("card");
  pen.beginPath();
  pen.roundRect(0, 0, width, height, 24);
  pen.fill();
}

function drawProgress(pen, y, width, [done, all]) {
  pen.fillStyle = color("line");
  pen.fillRect(EDGE, y, width - 2 * EDGE, 22);
  pen.fillStyle = color("accent");
  pen.fillRect(EDGE, y, ((width - 2 * EDGE) * Math.min(done, all)) / Math.max(all, 1), 22);
  pen.fillStyle = color("muted");
  pen.font = `32px ${FONT}`;
  pen.fillText(`${done} of ${all}`, EDGE, y + 58);
}

/** Draw counts of outcomes; returns where they end. */
function drawOutcomes(pen, top, width, outcomes) {
  pen.font = `32px ${FONT}`;
  let [x, y] = [EDGE, top];
  for (const [outcome, count] of Object.entries(outcomes)) {
    const text = `${outcome} ${count}`;
    const needed = pen.measureText(text).width + 60;
    if (x === EDGE || x + needed > width - EDGE) [x, y] = [EDGE, y + LINE];
    pen.fillStyle = colorOf(outcome);
    pen.beginPath();
    pen.arc(x + 11, y - 11, 11, 0, 7);
    pen.fill();
    pen.fillStyle = color("text");
    pen.fillText(text, x + 32, y);
    x += needed;
  }
  return y;
}

function wrap(pen, text, width) {
  const lines = [""];
  for (const word of text.split(" ")) {
    const longer = `${lines.at(-1)} ${word}`.trim();
    if (pen.measureText(longer).width <= width) lines[lines.length - 1] = longer;
    else lines.push(word);
  }
  return lines.filter(Boolean);
}
