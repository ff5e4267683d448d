/** Plots bound to links: panels that follow a link of a robot on the screen, or are docked below the view. */

import { get, setChoices } from "./dom.js";
import { keepLayout, readLayout } from "./layout.js";
import { PlotPanel } from "./plot_panel.js";
import { widestJoint } from "./throws.js";
import { readTooltips } from "./tooltips.js";

/** All plots, and the dialog that adds one. */
export class Plots {
  /** @type {PlotPanel[]} */
  panels = [];
  #simulations = [];
  /** Panels that the user has added, and not a description. */
  #own = new Set();
  /** Plots of the layout whose simulation was not shown yet. */
  #waiting = readLayout().plots ?? [];

  /**
   * @param {object} parts
   * @param {import("./scene.js").View} parts.view
   * @param {import("./playback.js").Playback} parts.playback
   * @param {import("./live.js").Live} parts.live
   */
  constructor({ view, playback, live }) {
    Object.assign(this, { view, playback, live });
    get("add-plot").addEventListener("click", () => this.#ask());
    get("plot-simulation").addEventListener("change", () => this.#offer());
    get("plot-field").addEventListener("change", () => this.#offer());
    get("plot-name").addEventListener("change", () => this.#bind());
    get("plot-dialog").firstElementChild.addEventListener("submit", ({ submitter }) => {
      if (submitter.value === "add" && get("plot-simulation").value) this.#add();
    });
    // Whether a panel follows its link may have changed.
    addEventListener("pagehide", () => this.#keep());
  }

  /** @param {string[]} simulations that are shown; plots of others are hidden */
  put(simulations) {
    this.#simulations = simulations;
    get("add-plot").disabled = !simulations.length;
  }

  /**
   * Add the plots that a description binds to links, unless they are there already, and those of the layout.
   * @param {string} simulation whose robot it describes
   * @param {string} urdf
   */
  bind(simulation, urdf) {
    for (const tooltip of readTooltips(urdf)) {
      const isThere = ({ choice }) => choice.simulation === simulation && choice.field === tooltip.field
        && choice.name === tooltip.name && choice.link === tooltip.link;
      if (!this.panels.some(isThere)) this.#put({ simulation, ...tooltip }, true);
    }
    const joints = this.view.stations.get(simulation)?.robot?.joints ?? [];
    const fits = ({ choice }) => choice.simulation === simulation && (choice.field === "ball" || joints.includes(choice.name));
    const fitting = this.#waiting.filter(fits);
    this.#waiting = this.#waiting.filter((each) => !fits(each));
    for (const { choice, follows } of fitting) this.#own.add(this.#put(choice, follows));
  }

  #keep() {
    keepLayout({ plots: [...this.#waiting, ...[...this.#own].map(({ choice, follows }) => ({ choice, follows }))] });
  }

  /** Draw new values, and move panels to their links. */
  draw() {
    const [lines, taken] = [[], []];
    for (const panel of this.panels) {
      const { simulation, link } = panel.choice;
      panel.element.hidden = !this.#simulations.includes(simulation);
      if (panel.element.hidden) continue;
      panel.draw(this.playback.at(simulation), this.live.simulations.has(simulation) ? this.live.momentsOf(simulation) : null);
      const at = panel.follows ? this.view.project(simulation, link) : null;
      if (at) lines.push(panel.follow(at, get("stage"), taken));
    }
    this.#drawLeaders(lines.filter(Boolean));
  }

  #ask() {
    const { shown } = this.view;
    setChoices(get("plot-simulation"), shown.map((name) => [name, name]));
    this.#offer();
    get("plot-dialog").showModal();
  }

  #robot() {
    return this.view.stations.get(get("plot-simulation").value)?.robot;
  }

  /** Offer the names that fit the chosen field, and the links. */
  #offer() {
    const robot = this.#robot();
    const isBall = get("plot-field").value === "ball";
    const names = isBall ? ["x", "y", "z"] : (robot?.joints ?? []);
    const before = get("plot-name").value;
    setChoices(get("plot-name"), names.map((name) => [name, name]));
    const shown = this.playback.at(get("plot-simulation").value)?.shown;
    if (!isBall && shown && !names.includes(before)) get("plot-name").value = widestJoint(shown);
    setChoices(get("plot-link"), (robot?.links ?? []).map((name) => [name, name]));
    this.#bind();
  }

  /** Bind a plot of a joint to the link that the joint moves, unless the user chooses another link. */
  #bind() {
    const link = this.#robot()?.linkMovedBy(get("plot-name").value);
    if (link) get("plot-link").value = link;
  }

  #add() {
    const [simulation, field, name, link] = ["simulation", "field", "name", "link"].map((key) => get(`plot-${key}`).value);
    this.#own.add(this.#put({ simulation, field, name, link }, get("plot-follows").checked));
    this.#keep();
  }

  #put(choice, follows) {
    const slides = this.view.stations.get(choice.simulation)?.robot?.slides(choice.name);
    const panel = new PlotPanel({ ...choice, slides }, follows, () => {
      this.panels.splice(this.panels.indexOf(panel), 1);
      if (this.#own.delete(panel)) this.#keep();
      get("add-plot").focus();
    });
    this.panels.push(panel);
    return panel;
  }

  #drawLeaders(lines) {
    const place = get("leaders");
    while (place.children.length > lines.length) place.lastElementChild.remove();
    while (place.children.length < lines.length) place.append(document.createElementNS(place.namespaceURI, "line"));
    lines.forEach((line, i) => {
      for (const [key, value] of Object.entries(line)) place.children[i].setAttribute(key, value.toFixed(1));
    });
  }
}
