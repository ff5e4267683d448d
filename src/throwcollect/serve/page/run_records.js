/** Events and logs of a run, fetched again and again as long as they are shown. */

import { make, setChoices, showProblem } from "./dom.js";
import { lives } from "./state.js";

const PERIOD_MS = 2000;
const TAIL = 200;

/** What has happened in a run, and what one of its nodes has printed. */
export class RunRecords {
  #timer = 0;
  #instance = null;

  /** @param {import("./connection.js").Connection} connection */
  constructor(connection) {
    this.connection = connection;
    this.choice = make("select");
    this.text = make("pre", { tabIndex: 0, role: "log", "aria-label": "events or log", "aria-live": "off" });
    this.problem = make("div", { className: "problem", role: "alert" });
    this.element = make("details", {}, make("summary", {}, "Events and logs"),
      make("label", {}, "Of ", this.choice), this.text, this.problem);
    this.element.addEventListener("toggle", () => this.#fetch());
    this.choice.addEventListener("change", () => this.#fetch());
  }

  /** @param {import("./state.js").Instance} instance */
  put(instance) {
    this.#instance = instance;
    const names = instance.nodes.map(({ name }) => name);
    const choices = [["", "events"], ...names.map((name) => [name, `log of ${name}`])];
    // After the end of a run, its nodes are not listed any more, but their logs stay.
    if (names.length || !this.choice.options.length) setChoices(this.choice, choices);
  }

  async #fetch() {
    clearTimeout(this.#timer);
    if (!this.element.open || !this.element.isConnected) return;
    const { id } = this.#instance;
    const node = this.choice.value;
    // If the user has chosen something else meanwhile, another request fetches that.
    const isChosen = () => node === this.choice.value;
    const run = `/instances/${encodeURIComponent(id)}`;
    try {
      const path = node ? `${run}/log/${encodeURIComponent(node)}?tail=${TAIL}` : `${run}/events`;
      const text = await (await this.connection.ask("GET", path)).text();
      if (isChosen()) this.#show(node ? text : inWords(text));
      if (isChosen()) showProblem(this.problem, null);
    } catch (error) {
      if (isChosen()) showProblem(this.problem, error);
    }
    if (lives(this.#instance)) this.#timer = setTimeout(() => this.#fetch(), PERIOD_MS);
  }

  #show(text) {
    if (this.text.textContent === text) return;
    const isAtEnd = this.text.scrollTop + this.text.clientHeight >= this.text.scrollHeight - 4;
    this.text.textContent = text || "nothing yet";
    if (isAtEnd) this.text.scrollTop = this.text.scrollHeight;
  }
}

/** Events, one in JSON a line, as lines for people. */
function inWords(text) {
  const lines = text.trim().split("\n").filter(Boolean).slice(-TAIL);
  return lines.map((line) => {
    const { time, run: _, event, ...facts } = JSON.parse(line);
    const words = Object.entries(facts).filter(([, value]) => value !== null && value !== "");
    return [new Date(time).toLocaleTimeString(), event, ...words.map(([key, value]) => `${key}=${inText(value)}`)].join("  ");
  }).join("\n");
}

function inText(value) {
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}
