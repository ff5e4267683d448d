/** One plot: a curve over a throw with the time of its replay, or over the last seconds of a live simulation. */

import uPlot from "./vendor/uplot/dist/uPlot.esm.js";
import { get, make, makeButton, setText } from "./dom.js";
import { EDGE_PX, placeApart } from "./places.js";
import { seriesOf } from "./throws.js";

const UNITS = { position: "rad", velocity: "rad/s", effort: "Nm", ball: "m" };
const SLIDING_UNITS = { position: "m", velocity: "m/s", effort: "N" };
const HEIGHT_PX = 120;
const SPAN_S = 10;
const NUMBERS_MS = 500;
const GAP_PX = 70;
const MOST_GAP = 0.08;

/** @typedef {{simulation: string, field: "position" | "velocity" | "effort" | "ball", name: string, link: string}} Choice */

/** A panel with a plot, its buttons, and a table of its numbers. */
export class PlotPanel {
  #shown = null;
  #live = false;
  #time = 0;
  #last = -1;
  #zoomed = null;
  #told = 0;
  #x = [];
  #y = [];

  /**
   * @param {Choice} choice what is plotted, and its link
   * @param {boolean} follows whether the panel follows the link
   * @param {() => void} closed called when the user has closed the panel
   */
  constructor(choice, follows, closed) {
    this.choice = choice;
    const title = `${choice.field === "ball" ? `ball ${choice.name}` : `${choice.name} ${choice.field}`} [${(choice.slides ? SLIDING_UNITS : UNITS)[choice.field]}]`;
    const button = (text, label, act) => makeButton(text, act, { title: label, "aria-label": `${label}: ${title}` });
    this.now = make("output", { className: "now" });
    this.title = title;
    this.collapser = button("–", "collapse", () => this.collapse());
    this.follower = button("⚓", "dock", () => this.#place(!this.follows));
    const head = make("div", { className: "plot-head" }, make("strong", {}, title), this.now,
      button("+", "zoom in", () => this.#zoom(0.5)), button("−", "zoom out", () => this.#zoom(2)),
      button("↔", "all of it", () => this.#zoom(null)), this.follower, this.collapser,
      button("×", "close", () => {
        this.#plot.destroy();
        this.element.remove();
        closed();
      }));
    this.body = make("div", { className: "plot-body" });
    this.cells = ["now", "least", "mean", "most"].map((name) => [name, make("td", {}, "–")]);
    this.table = make("table", {}, make("caption", {}, `${title}, ${choice.simulation}, at ${choice.link}`),
      ...this.cells.map(([name, cell]) => make("tr", {}, make("th", { scope: "row" }, name), cell)));
    const numbers = make("details", {}, make("summary", {}, "Numbers"), this.table);
    this.element = make("section", { className: "plot", "aria-label": title }, head, this.body, numbers);
    this.#place(follows);
    this.#plot = new uPlot(this.#options(), [[], []], this.body);
    this.line = make("div", { className: "plot-now" });
    this.#plot.over.append(this.line);
    new ResizeObserver(() => this.#fit()).observe(this.body);
  }

  /**
   * Draw new values.
   * @param {{shown: import("./throws.js").Throw, time: number} | undefined} replay
   * @param {import("./live.js").Moment[] | null} moments of a live simulation; null if it is replayed
   */
  draw(replay, moments) {
    if (moments) this.#drawLive(moments);
    else if (replay) this.#drawThrow(replay);
    if (performance.now() - this.#told > NUMBERS_MS) this.#tell();
  }

  /**
   * Move the panel to its link, beside other panels; dock it if there is no room for it, as on a phone.
   * @param {{x: number, y: number}} at on the stage [px]
   * @param {Element} stage
   * @param {import("./places.js").Box[]} taken boxes of other panels; the box of this panel is added
   * @returns {{x1: number, y1: number, x2: number, y2: number} | null} line from the panel to the link, unless it was docked
   */
  follow(at, stage, taken) {
    const { offsetWidth: width, offsetHeight: height } = this.element;
    const [most, lowest] = [stage.clientWidth - width - EDGE_PX, stage.clientHeight - height - EDGE_PX];
    const gap = Math.min(GAP_PX, stage.clientWidth * MOST_GAP);
    const isRight = at.x + gap + width < stage.clientWidth;
    const wanted = {
      left: Math.max(EDGE_PX, Math.min(isRight ? at.x + gap : at.x - gap - width, most)),
      top: Math.max(EDGE_PX, Math.min(at.y - height - gap, lowest)),
    };
    const place = placeApart({ ...wanted, width, height }, taken, { most, lowest });
    if (!place) {
      this.#place(false);
      return null;
    }
    const { left, top } = place;
    taken.push({ left, top, width, height });
    this.element.style.transform = `translate(${left.toFixed(1)}px, ${top.toFixed(1)}px)`;
    const x1 = Math.max(left, Math.min(at.x, left + width));
    const y1 = Math.max(top, Math.min(at.y, top + height));
    return { x1, y1, x2: at.x, y2: at.y };
  }

  /**
   * What the panel shows: its present value, its curve unless it is collapsed, and the place of the present in it [px].
   * @returns {{title: string, now: string, canvas: HTMLCanvasElement | null, at: number | null}}
   */
  get picture() {
    const isClosed = this.element.classList.contains("collapsed");
    const at = this.#live || !this.#y.length ? null : this.#plot.valToPos(this.#time, "x", true);
    return { title: this.title, now: this.now.value, canvas: isClosed ? null : this.#plot.ctx.canvas, at };
  }

  #plot;

  #drawThrow({ shown, time }) {
    if (this.#shown !== shown) {
      this.#shown = shown;
      if (this.#live) this.#zoomed = null;
      this.#live = false;
      const series = seriesOf(shown, this.choice.field, this.choice.name);
      this.#x = Float64Array.from({ length: series ? shown.samples : 0 }, (_, i) => i / shown.rate_hz);
      this.#y = series ?? [];
      this.#plot.setData([this.#x, this.#y], false);
      this.#show(this.#zoomed ?? [0, shown.duration]);
      if (!series) setText(this.now, "throws do not tell it; watch live");
    }
    if (!this.#y.length) return;
    this.line.hidden = false;
    this.#time = time;
    this.line.style.transform = `translateX(${this.#plot.valToPos(time, "x").toFixed(1)}px)`;
    this.#say(this.#y[Math.min(this.#y.length - 1, Math.round(time * shown.rate_hz))]);
  }

  #drawLive(moments) {
    if (!moments.length || moments.at(-1).time === this.#last) return;
    if (!this.#live) this.#zoomed = null;
    this.#live = true;
    this.#shown = null;
    this.line.hidden = true;
    this.#last = moments.at(-1).time;
    const { field, name } = this.choice;
    const value = ({ ball, ...moment }) => (field === "ball" ? ball?.["xyz".indexOf(name)] : moment[field][name]);
    this.#x = moments.map(({ time }) => time - this.#last);
    this.#y = moments.map((moment) => value(moment) ?? null);
    this.#plot.setData([this.#x, this.#y], false);
    this.#show(this.#zoomed ?? [-SPAN_S, 0]);
    this.#say(this.#y.at(-1));
  }

  #say(value) {
    setText(this.now, Number.isFinite(value) ? value.toFixed(3) : "–");
  }

  #tell() {
    this.#told = performance.now();
    const values = [...this.#y].filter(Number.isFinite);
    const numbers = values.length
      ? [Number(this.now.value), Math.min(...values), values.reduce((sum, value) => sum + value, 0) / values.length, Math.max(...values)]
      : [];
    this.cells.forEach(([, cell], i) => setText(cell, Number.isFinite(numbers[i]) ? numbers[i].toFixed(3) : "–"));
  }

  #show([min, max]) {
    this.#plot.setScale("x", { min, max });
  }

  #zoom(factor) {
    if (factor === null) {
      this.#zoomed = null;
      this.#show(this.#live ? [-SPAN_S, 0] : [0, this.#shown?.duration ?? 1]);
      return;
    }
    const { min, max } = this.#plot.scales.x;
    const middle = this.#live ? max : (min + max) / 2;
    this.#zoomed = [middle + (min - middle) * factor, middle + (max - middle) * factor];
    this.#show(this.#zoomed);
  }

  /** Show only its head, or all of it again. */
  collapse() {
    const isClosed = this.element.classList.toggle("collapsed");
    setText(this.collapser, isClosed ? "□" : "–");
    this.collapser.setAttribute("aria-expanded", String(!isClosed));
  }

  #place(follows) {
    this.follows = follows;
    this.element.style.transform = "";
    get(follows ? "following" : "docked").append(this.element);
    this.follower.title = follows ? "dock below the view" : "follow the link";
    this.follower.setAttribute("aria-pressed", String(!follows));
  }

  #fit() {
    const width = this.body.clientWidth;
    if (width > 0 && width !== this.#plot.width) this.#plot.setSize({ width, height: HEIGHT_PX });
  }

  #options() {
    const style = () => getComputedStyle(this.element);
    const axis = {
      stroke: () => style().getPropertyValue("--muted"),
      grid: { stroke: () => style().getPropertyValue("--grid"), width: 1 },
      ticks: { show: false },
      font: "10px system-ui, sans-serif",
    };
    return {
      width: 240,
      height: HEIGHT_PX,
      legend: { show: false },
      cursor: { drag: { x: true, y: false }, points: { show: false } },
      scales: { x: { time: false } },
      axes: [{ ...axis, size: 22, values: (_, ticks) => ticks.map((tick) => `${+tick.toFixed(2)} s`) }, { ...axis, size: 42 }],
      series: [{}, { stroke: () => style().getPropertyValue("--accent"), width: 1.5, points: { show: false } }],
      hooks: {
        setSelect: [({ select: { left, width } }) => {
          // A zoom by dragging stays when the next throw comes.
          if (width > 0) this.#zoomed = [this.#plot.posToVal(left, "x"), this.#plot.posToVal(left + width, "x")];
        }],
      },
    };
  }
}
