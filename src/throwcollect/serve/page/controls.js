/** Components to start, and runs to look after. */

import { get, make, makeButton, setChoices, setText, showProblem } from "./dom.js";
import { legendItem } from "./landing_map.js";
import { RunRecords } from "./run_records.js";
import { saveFile } from "./saving.js";
import { lives, steps } from "./state.js";
import { count } from "./words.js";

const KINDS = {
  collection: "collects a dataset",
  session: "simulations for clients, without a dataset",
  container: "a container, which may join a run",
};
const WORDS = { starting: "is starting", running: "runs", ended: "has ended", died: "died" };

/**
 * Read changed keys, one a line.
 * @param {string} text lines such as `trials: 50`; a value is JSON, or a text
 * @returns {Record<string, unknown>}
 * @throws {Error} if a line is malformed
 */
export function readChanges(text) {
  const changes = {};
  text.split("\n").forEach((line, i) => {
    if (!line.trim()) return;
    const [, key, value] = line.match(/^\s*([\w.]+)\s*[:=]\s*(.+?)\s*$/) ?? [];
    if (key === undefined) throw new Error(`line ${i + 1}: should be KEY: VALUE, such as trials: 50, got '${line.trim()}'`);
    try {
      changes[key] = JSON.parse(value);
    } catch {
      changes[key] = value;
    }
  });
  return changes;
}

/** Cards of components and runs, which follow the state. */
export class Controls {
  #components = new Map();
  #instances = new Map();

  /**
   * @param {import("./connection.js").Connection} connection
   * @param {(id: string) => void} watch shows a run
   */
  constructor(connection, watch) {
    this.connection = connection;
    this.watch = watch;
  }

  /** @param {import("./state.js").State} state */
  put(state) {
    this.joinable = state.instances.filter((each) => lives(each) && each.kind !== "container").map(({ id }) => id);
    keep(get("components"), this.#components, state.components, (each) => each.name, () => new ComponentCard(this));
    const living = state.instances.filter(lives);
    const ended = state.instances.filter((each) => !lives(each));
    const makeCard = () => new InstanceCard(this);
    const known = new Set(state.instances.map(({ id }) => id));
    for (const [id, card] of this.#instances) {
      if (!known.has(id)) {
        card.element.remove();
        this.#instances.delete(id);
      }
    }
    keep(get("instances"), this.#instances, living, (each) => each.id, makeCard);
    keep(get("ended"), this.#instances, ended, (each) => each.id, makeCard);
    get("no-instances").hidden = living.length > 0;
    // At first, runs that have ended are offered if there is nothing else to watch.
    if (get("ended-box").hidden && !living.length) get("ended").parentElement.open = true;
    get("ended-box").hidden = ended.length === 0;
    setText(get("ended-count"), String(ended.length));
  }
}

/** Put cards into an element in this order; a card that is at its position already is not moved. */
function keep(place, cards, things, keyOf, makeCard) {
  things.forEach((thing, i) => {
    const key = keyOf(thing);
    if (!cards.has(key)) cards.set(key, makeCard());
    const card = cards.get(key);
    card.put(thing);
    if (place.children[i] !== card.element) place.insertBefore(card.element, place.children[i] ?? null);
  });
  while (place.children.length > things.length) place.lastElementChild.remove();
}

/** Number of lists that have been made, so that each has an id of its own. */
let numbered = 0;

/** A component, and the form that starts an instance of it. */
class ComponentCard {
  /** @type {Map<string, {value: unknown, takes: string}> | null} keys that may be set; null before they are known */
  #known = null;

  constructor(controls) {
    this.controls = controls;
    this.name = make("h3");
    this.facts = make("p", { className: "muted" });
    this.joins = make("select");
    this.simulations = make("input", { type: "number", min: "1", max: "256", placeholder: "auto", inputMode: "numeric" });
    this.changes = make("textarea", { rows: 2, spellcheck: false, placeholder: "trials: 50" });
    this.problem = make("div", { className: "problem", role: "alert" });
    this.button = make("button", { type: "submit" }, "Start");
    this.keys = make("datalist", { id: `keys-${++numbered}` });
    this.key = make("input", { type: "text", spellcheck: false, autocomplete: "off", placeholder: "find a key, such as ball.mass_kg", "aria-label": "find a key" });
    this.key.setAttribute("list", this.keys.id);
    this.key.addEventListener("input", () => this.#insert());
    this.takes = make("p", { className: "muted" });
    this.more = make("details", {}, make("summary", {}, "Change the configuration"), this.key, this.keys, this.takes,
      make("label", {}, "One key a line, KEY: VALUE ", this.changes));
    this.more.addEventListener("toggle", () => this.#offerKeys());
    this.count = make("label", {}, "Simulations ", this.simulations);
    this.run = make("label", {}, "Joins ", this.joins);
    this.form = make("form", {}, make("div", { className: "row" }, this.count, this.run, this.button), this.more,
      this.problem);
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#start();
    });
    this.element = make("article", { className: "card" }, this.name, this.facts, this.form);
  }

  /** @param {import("./state.js").Component} component */
  put(component) {
    this.component = component;
    setText(this.name, component.pretty_name);
    setText(this.facts, `${KINDS[component.kind]} · ${component.instances.length} of at most ${component.max_instances} live`);
    this.button.setAttribute("aria-label", `Start ${component.pretty_name}`);
    const isContainer = component.kind === "container";
    for (const element of [this.count, this.more]) element.hidden = isContainer;
    this.run.hidden = !isContainer;
    if (isContainer) setChoices(this.joins, [["", "no run"], ...this.controls.joinable.map((id) => [id, id])]);
  }

  async #offerKeys() {
    if (!this.more.open || this.#known) return;
    this.#known = new Map();
    try {
      const found = await this.controls.connection.read("GET", `/components/${encodeURIComponent(this.component.name)}/keys`);
      for (const { key, value, takes } of found) this.#known.set(key, { value, takes });
      this.keys.replaceChildren(...found.map(({ key, value }) => make("option", { value: key }, JSON.stringify(value))));
    } catch (error) {
      this.#known = null;
      showProblem(this.problem, error);
    }
  }

  /** Write the key that was found into a line of its own, with the value that it has. */
  #insert() {
    const found = this.#known?.get(this.key.value);
    if (!found) {
      setText(this.takes, "");
      return;
    }
    const { key: { value: key }, changes } = this;
    setText(this.takes, `${key}: ${found.takes === "anything" ? "any value" : found.takes}`);
    const lines = changes.value.split("\n").filter((line) => line.trim() && !line.startsWith(`${key}:`));
    const line = `${key}: ${JSON.stringify(found.value)}`;
    changes.value = [...lines, line].join("\n");
    changes.rows = Math.max(2, lines.length + 1);
    this.key.value = "";
    changes.focus();
    // The value is selected, so that typing replaces it.
    changes.setSelectionRange(changes.value.length - line.length + key.length + 2, changes.value.length);
  }

  async #start() {
    showProblem(this.problem, null);
    this.button.disabled = true;
    try {
      const body = { component: this.component.name };
      if (this.component.kind === "container") {
        if (this.joins.value) body.joins = this.joins.value;
      } else {
        body.set = readChanges(this.changes.value);
        if (this.simulations.value) body.simulations = Number(this.simulations.value);
      }
      const instance = await this.controls.connection.read("POST", "/instances", body);
      if (instance.kind !== "container") this.controls.watch(instance.id);
    } catch (error) {
      showProblem(this.problem, error);
    } finally {
      this.button.disabled = false;
    }
  }
}

/** A run, and what can be done with it. */
class InstanceCard {
  constructor(controls) {
    this.controls = controls;
    this.name = make("h3");
    this.status = make("p", { className: "status", role: "status" });
    this.bar = make("progress", { max: 1, value: 0 });
    this.counts = make("p");
    this.outcomes = make("ul", { className: "legend", "aria-label": "outcomes" });
    this.nodes = make("p", { className: "muted" });
    this.problem = make("div", { className: "problem", role: "alert" });
    this.watch = makeButton("Watch", () => controls.watch(this.instance.id));
    this.stop = makeButton("Stop", () => this.#ask("DELETE", ""));
    this.force = makeButton("End now", () => this.#force());
    this.resume = makeButton("Resume", () => this.#resume());
    this.report = makeButton("Save report", () => this.#save("report", "html", "the report is being made, which takes some seconds …"), {
      title: "a page with figures, which opens without this server",
    });
    this.download = makeButton("Save dataset", () => this.#save("dataset.tar", "tar", "the dataset is being packed …"), { title: "all files as one .tar" });
    this.saved = make("p", { className: "muted", role: "status" });
    this.simulations = make("input", { type: "number", min: "0", max: "256", inputMode: "numeric" });
    this.scale = make("form", { className: "row" }, make("label", {}, "Simulations ", this.simulations),
      make("button", { type: "submit" }, "Scale"));
    this.scale.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#ask("PATCH", "", { simulations: Number(this.simulations.value) });
    });
    this.records = new RunRecords(controls.connection);
    this.element = make("article", { className: "card" }, this.name, this.status, this.bar, this.counts, this.outcomes,
      this.nodes, make("div", { className: "row" }, this.watch, this.stop, this.resume, this.report, this.download,
        this.force), this.saved, this.scale, this.problem,
      this.records.element);
  }

  /** @param {import("./state.js").Instance} instance */
  put(instance) {
    const before = this.instance;
    this.instance = instance;
    const isLiving = lives(instance);
    setText(this.name, instance.id);
    setText(this.status, `${isLiving && instance.stopping ? "is stopping" : WORDS[instance.status]}${instance.message ? `: ${instance.message}` : ""}`);
    this.status.dataset.status = instance.status;
    this.#putProgress(instance.progress);
    const troubled = instance.nodes.filter(({ status }) => !["running", "starting"].includes(status));
    const joined = instance.joins ? `joined ${instance.joins}` : "";
    const all = instance.nodes.length ? `${instance.nodes.length} ${instance.nodes.length === 1 ? "node" : "nodes"}` : "";
    setText(this.nodes, [joined, all, ...troubled.map(({ name, status }) => `${name} ${status}`)].filter(Boolean).join(", "));
    this.stop.hidden = !isLiving;
    this.scale.hidden = !isLiving || instance.kind === "container";
    this.watch.hidden = instance.kind === "container";
    const isOver = !isLiving && instance.kind === "collection";
    this.resume.hidden = !instance.can_be_resumed;
    for (const element of [this.report, this.download]) element.hidden = !isOver || instance.summary === null;
    setText(this.force, isLiving ? "End now" : "Forget");
    if (before?.simulations !== instance.simulations) this.simulations.value = String(instance.simulations);
    const buttons = [this.watch, this.stop, this.resume, this.report, this.download, this.force];
    for (const each of buttons) each.setAttribute("aria-label", `${each.textContent} ${instance.id}`);
    this.records.put(instance);
  }

  #putProgress(progress) {
    for (const element of [this.bar, this.counts, this.outcomes]) element.hidden = progress === null;
    if (progress === null) return;
    const [done, all] = steps(progress);
    this.bar.max = Math.max(all, 1);
    this.bar.value = done;
    this.bar.setAttribute("aria-label", `${done} of ${all}`);
    const speed = lives(this.instance) ? `, ${progress.throws_per_s.toFixed(1)} ${progress.noun}s/s` : "";
    setText(this.counts, `${done} of ${count(all, progress.noun)}${speed}`);
    const outcomes = JSON.stringify(progress.outcomes);
    if (this.outcomes.dataset.shown === outcomes) return;
    this.outcomes.dataset.shown = outcomes;
    this.outcomes.replaceChildren(...Object.entries(progress.outcomes).map(([word, count]) => legendItem(word, count)));
  }

  async #force() {
    const { id } = this.instance;
    const what = lives(this.instance) ? `End ${id} at once? What its simulations do at the moment is lost; ` : `Forget ${id}? `;
    if (await confirm(`${what}it disappears from this list. Its dataset is kept.`)) await this.#ask("DELETE", "?force=true");
  }

  #ask(method, query, body) {
    return this.#attempt(() => this.controls.connection.ask(method, `/instances/${this.#id}${query}`, body));
  }

  #resume() {
    return this.#attempt(async () => {
      const resumed = await this.controls.connection.read("POST", `/collections/${this.#id}/resume`);
      this.controls.watch(resumed.id);
    });
  }

  /** Save a file that the server makes from a finished dataset; a plain link would not do, as it sends no token. */
  async #save(what, suffix, meanwhile) {
    const name = `${this.instance.id}.${suffix}`;
    setText(this.saved, meanwhile);
    let told = "";
    await this.#attempt(async () => {
      const answer = await this.controls.connection.ask("GET", `/collections/${this.#id}/${what}`);
      saveFile(await answer.blob(), name);
      told = `${name} is saved where the browser puts downloads`;
    });
    setText(this.saved, told);
  }

  get #id() {
    return encodeURIComponent(this.instance.id);
  }

  async #attempt(act) {
    showProblem(this.problem, null);
    try {
      await act();
    } catch (error) {
      showProblem(this.problem, error);
    }
  }
}

/**
 * Ask the user.
 * @param {string} question
 * @returns {Promise<boolean>}
 */
function confirm(question) {
  const dialog = get("ask-dialog");
  setText(get("ask-text"), question);
  dialog.returnValue = "";
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"), { once: true });
  });
}
