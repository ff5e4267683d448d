/** The page: puts its parts together. */

import { Bodies } from "./bodies.js";
import { Connection, Problem, keepToken, takeToken } from "./connection.js";
import { Controls } from "./controls.js";
import { get, makeButton, setChoices, setText } from "./dom.js";
import { listenForKeys } from "./keys.js";
import { LandingMap } from "./landing_map.js";
import { keepLayout, readLayout } from "./layout.js";
import { Live } from "./live.js";
import { LiveSensors } from "./live_sensors.js";
import { Models } from "./model.js";
import { Playback } from "./playback.js";
import { Plots } from "./plots.js";
import { REPLAY, Replay } from "./replay.js";
import { Meshes } from "./robot.js";
import { Room } from "./room.js";
import { View } from "./scene.js";
import { SensorStrip } from "./sensor_strip.js";
import { StoredSensors } from "./stored_sensors.js";
import { inOrder, lives, steps, watchable } from "./state.js";
import { Target } from "./target.js";
import { Watching } from "./watching.js";
import { addSuccess } from "./outcomes.js";

/** Most simulations in one grid; the others are on further pages of the grid. */
const MOST_TILES = 16;
/** Most pictures a second. */
const RATE_HZ = 30;

function say(kind, text) {
  const place = get("connection");
  place.dataset.kind = kind;
  setText(place, text);
}

/** Ask for a token, and begin with it. */
function signIn(why) {
  get("page").hidden = true;
  const form = get("sign-in");
  form.hidden = false;
  setText(get("sign-in-why"), why);
  say("lost", "not connected");
  get("token").focus();
  form.onsubmit = async (event) => {
    event.preventDefault();
    const token = get("token").value.trim();
    try {
      await new Connection(token).ask("GET", "/components");
    } catch (error) {
      setText(get("sign-in-why"), error.message);
      return;
    }
    keepToken(token);
    location.reload();
  };
}

/** @typedef {{run: string | null, trial: number | null, compared: number | null}} Link */

/** @returns {Link} run and throws that the address names */
function readLink() {
  const parts = new URLSearchParams(location.hash.slice(1));
  const number = (name) => (/^\d+$/.test(parts.get(name) ?? "") ? Number(parts.get(name)) : null);
  return { run: parts.get("run"), trial: number("trial"), compared: number("compared") };
}

/** The page of a user who has a token. */
class Page {
  /** @type {import("./state.js").Instance[]} runs, as the newest state has them */
  #instances = [];
  #first = 0;
  #before = 0;
  /** When the next picture is wanted [ms]. */
  #due = 0;
  /** @type {Link} what the address names, until it is shown */
  #named;

  /**
   * @param {string} token
   * @param {Link} named what the address names
   */
  constructor(token, named) {
    this.#named = named;
    this.connection = new Connection(token);
    this.view = new View(get("canvas"));
    this.map = new LandingMap((x, y) => this.target.setOnGround(x, y), (trial) => this.replay.show(trial));
    this.playback = new Playback((shown) => this.watching.begin(shown));
    const fetchMesh = async (path) => (await this.connection.ask("GET", `/meshes/${path}`)).arrayBuffer();
    this.meshes = new Meshes(fetchMesh);
    Bodies.meshes = this.meshes;
    Bodies.loaded = () => this.view.touch();
    const { connection, view, playback, map, meshes } = this;
    const tell = (text) => this.tell(text);
    this.watching = new Watching({ connection, view, playback, map, meshes, tell });
    this.replay = new Replay({ connection, view, playback, map, tell, changed: () => this.#show() });
    this.watching.replay = this.replay;
    this.strip = new SensorStrip(view);
    this.storedSensors = new StoredSensors({ connection, playback, replay: this.replay, strip: this.strip });
    this.watching.stored.came = () => this.#offerThrows();
    this.live = new Live({ connection, view, watching: this.watching, tell, choose: () => this.#chooseOne() });
    this.liveSensors = new LiveSensors({ live: this.live, strip: this.strip });
    this.plots = new Plots({ view, playback, live: this.live });
    this.watching.described = (simulation, urdf) => this.plots.bind(simulation, urdf);
    const watch = (id) => this.#watch(id);
    this.models = new Models({ connection, map, changed: () => this.#showBoxes() });
    this.target = new Target({ view, map, live: this.live, aim: (place) => this.models.aimAt(place) });
    this.room = new Room({ view, map, target: this.target, plots: this.plots, strip: this.strip, tell, advance: (seconds) => this.#advance(seconds), facts: () => this.#facts() });
    this.controls = new Controls(connection, watch);
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) this.playback.playing = false;
    this.#restoreLayout();
    this.#listen();
    this.#connect();
    requestAnimationFrame((now) => this.#frame(now));
  }

  /** @param {string} text says what is wrong in the view */
  tell(text) {
    setText(get("view-note"), text);
  }

  #restoreLayout() {
    const { speed, filter } = readLayout();
    if (filter) this.map.filter.put(filter);
    if ([...get("speed").options].some(({ value }) => value === speed)) get("speed").value = speed;
    this.playback.speed = Number(get("speed").value);
    this.map.changed = () => {
      keepLayout({ filter: this.map.filter.choice });
      this.replay.put();
    };
  }

  #connect() {
    this.socket = this.connection.open("/state", {
      opened: () => {
        say("connected", "connected");
        this.models.list();
      },
      receive: (text) => this.#put(JSON.parse(text)),
      lost: (waitMs) => this.#lost(waitMs),
    });
  }

  async #lost(waitMs) {
    say("lost", `connection lost; next try in ${Math.ceil(waitMs / 1000)} s`);
    try {
      await this.connection.ask("GET", "/components");
    } catch (error) {
      if (!(error instanceof Problem) || error.status !== 401) return;
      this.socket.close();
      this.watching.put(undefined);
      this.live.put(undefined, "");
      keepToken(null);
      signIn("The server does not know this token: it has been started anew.");
    }
  }

  #put(state) {
    this.#instances = state.instances;
    this.controls.put(state);
    for (const { progress } of state.instances) if (progress) addSuccess(progress.success);
    const ids = watchable(state.instances, [this.watching.id, this.#named.run]);
    const wanted = ids.includes(this.#named.run) ? this.#named.run : get("watched").value;
    if (this.#named.run !== null && !ids.includes(this.#named.run)) {
      this.tell(`this machine remembers no run ${this.#named.run}`);
      this.#named = { run: null, trial: null, compared: null };
    }
    this.#named.run = null;
    const over = state.instances.filter((each) => !lives(each) && (each.kind === "collection" || ids.includes(each.id)));
    const living = ids.filter((id) => !over.some((each) => each.id === id));
    setChoices(get("watched"), [
      ...(ids.length ? [] : [["", "none"]]), ...living.map((id) => [id, id]), ...over.map(({ id, status }) => [id, `${id} (${status})`]),
    ]);
    this.#watch(ids.includes(wanted) ? wanted : (ids[0] ?? ""));
  }

  /** @param {string} id of the run to show */
  #watch(id) {
    const select = get("watched");
    if (id && ![...select.options].some(({ value }) => value === id)) {
      setChoices(select, [...[...select.options].filter(({ value }) => value).map(({ value }) => [value, value]), [id, id]]);
    }
    select.value = id;
    const instance = this.#instances.find((each) => each.id === id);
    const isOther = this.watching.id !== (instance?.id ?? null);
    if (isOther) {
      this.#first = 0;
      this.tell("");
      this.replay.begin(instance?.id ?? null);
    }
    this.watching.put(instance);
    if (instance?.progress) this.map.name(instance.progress.noun);
    if (isOther) this.replay.put();
    if (instance && !lives(instance) && this.view.shown.length && !this.replay.isOn) this.tell(`${instance.id} has ended; its last throws are replayed`);
    this.#showBoxes();
    const names = this.#names(instance);
    setChoices(get("alone"), [["", "all"], ...names.map((name) => [name, name])]);
    this.#show();
  }

  /** Replay the throw that the address names or, of a run that has ended, the first one. */
  #offerThrows() {
    const { instance, stored } = this.watching;
    const { trial, compared } = this.#named;
    this.#named = { run: null, trial: null, compared: null };
    const isEmpty = !lives(instance) && !this.view.shown.length && !this.replay.isOn;
    if (!stored.problem && trial !== null) this.replay.show(trial, compared);
    else if (!stored.problem && isEmpty) {
      const { list, filter } = this.map;
      const first = list.find(null, 1, filter.accepts) ?? list.find(null, 1, () => true);
      if (first !== null) this.replay.show(first);
    }
    this.#showBoxes();
    this.#show();
  }

  /** @param {Link} link to a run and a throw of this server */
  open(link) {
    this.#named = link;
    const { run, trial } = link;
    if (this.watching.id === run) {
      if (trial !== null && trial !== this.replay.shown?.trial) this.replay.show(trial, link.compared);
      return;
    }
    this.#watch(this.#instances.some(({ id }) => id === run) ? run : this.watching.id ?? "");
  }

  #showBoxes() {
    const { instance, stored } = this.watching;
    const isGone = Boolean(instance) && !lives(instance) && stored.problem !== "";
    get("map-box").hidden = (instance?.kind !== "collection" || isGone) && !this.models.isOnMap;
    get("target-box").hidden = (!instance || isGone) && !this.models.isOnMap;
  }

  /** Simulations of a run; after its end, the simulations that the page has shown. */
  #names(instance) {
    if (!instance) return [];
    const seen = [...this.view.stations.keys()].filter((name) => name !== REPLAY);
    return inOrder(lives(instance) || !seen.length ? instance.robots : seen);
  }

  #show() {
    const instance = this.watching.instance;
    const names = this.#names(instance);
    const { isOn } = this.replay;
    if (isOn) get("alone").value = "";
    const alone = get("alone").value;
    if (this.#first >= names.length) this.#first = 0;
    const shown = isOn ? [REPLAY] : alone ? [alone] : names.slice(this.#first, this.#first + MOST_TILES);
    if (shown.join() !== this.view.shown.join() || shown.some((name) => !this.view.stations.get(name)?.robot)) {
      this.watching.show(shown);
    }
    this.#label(alone || isOn ? [] : shown);
    get("alone-box").hidden = !names.length;
    get("newest").hidden = !isOn || !names.length;
    get("pages").hidden = Boolean(alone) || isOn || names.length <= MOST_TILES;
    setText(get("page-shown"), `${this.#first + 1} to ${this.#first + shown.length} of ${names.length}`);
    setText(get("empty"), shown.length ? "" : emptiness(instance, this.watching.stored.problem));
    this.live.put(instance, alone);
    this.plots.put(shown);
  }

  /** Names of the tiles; each is a button that shows its simulation alone. */
  #label(names) {
    const place = get("tiles");
    if (place.dataset.names !== names.join()) {
      place.dataset.names = names.join();
      place.replaceChildren(...names.map((name) => makeButton(name, () => this.#alone(name), { title: `show ${name} alone` })));
    }
    names.forEach((name, i) => {
      const { left, top } = this.view.tileOf(name);
      place.children[i].style.transform = `translate(${left}px, ${top}px)`;
    });
  }

  #alone(name) {
    get("alone").value = name;
    this.replay.leave();
    this.#show();
  }

  /** Show a simulation alone, because the user wants to see it live. */
  #chooseOne() {
    const [name] = this.#names(this.watching.instance);
    if (name) this.#alone(name);
  }

  #number(key) {
    const name = this.view.shown.length > 1 ? this.view.shown[key - 1] : this.#names(this.watching.instance)[key - 1];
    if (name) this.#alone(name);
  }

  #turnPages(by) {
    this.#first = Math.max(0, this.#first + by * MOST_TILES);
    this.#show();
  }

  #toggle() {
    this.playback.playing = !this.playback.playing;
    this.#showTransport();
  }

  #seekBy(seconds) {
    this.playback.seek(Math.max(0, Number(get("scrub").value) + seconds));
  }

  #listen() {
    get("watched").addEventListener("change", ({ target }) => this.#watch(target.value));
    get("alone").addEventListener("change", ({ target }) => this.#alone(target.value));
    get("page-before").addEventListener("click", () => this.#turnPages(-1));
    get("page-after").addEventListener("click", () => this.#turnPages(1));
    get("play").addEventListener("click", () => this.#toggle());
    get("scrub").addEventListener("input", ({ target }) => this.playback.seek(Number(target.value)));
    get("speed").addEventListener("change", ({ target }) => {
      this.playback.speed = Number(target.value);
      keepLayout({ speed: target.value });
    });
    get("keys-button").addEventListener("click", () => get("keys-dialog").showModal());
    new ResizeObserver(() => this.#show()).observe(get("stage"));
    window.addEventListener("online", () => this.socket?.hurry());
    const { view } = this;
    listenForKeys([
      { keys: [" ", "k"], text: "pause or play", act: () => this.#toggle() },
      { keys: [","], text: "a hundredth of a second back", act: () => this.#seekBy(-0.01) },
      { keys: ["."], text: "a hundredth of a second on", act: () => this.#seekBy(0.01) },
      { keys: ["1", "2", "3", "4", "5", "6", "7", "8", "9"], text: "one simulation alone", act: (key) => this.#number(key) },
      { keys: ["g"], text: "all simulations", act: () => this.#alone("") },
      { keys: ["l"], text: "live or replay", act: () => get("live").click() },
      { keys: ["n"], text: "next stored throw", act: () => this.replay.step(1) },
      { keys: ["b"], text: "stored throw before", act: () => this.replay.step(-1) },
      { keys: ["c"], text: "compare with this throw, or end that", act: () => get("compare").click() },
      { keys: ["p"], text: "add a plot", act: () => get("add-plot").click() },
      { keys: ["?"], text: "this list", act: () => get("keys-dialog").showModal() },
    ], [
      { keys: ["ArrowLeft"], text: "turn to the left", act: () => view.turn(-1, 0) },
      { keys: ["ArrowRight"], text: "turn to the right", act: () => view.turn(1, 0) },
      { keys: ["ArrowUp"], text: "look from higher up", act: () => view.turn(0, 1) },
      { keys: ["ArrowDown"], text: "look from lower down", act: () => view.turn(0, -1) },
      { keys: ["+", "="], text: "nearer", act: () => view.zoom(1) },
      { keys: ["-"], text: "farther", act: () => view.zoom(-1) },
      { keys: ["0"], text: "as it began", act: () => view.reset() },
    ]);
  }

  #frame(now) {
    requestAnimationFrame((next) => this.#frame(next));
    const since = now - this.#before;
    // In a room, the device itself requests pictures.
    if (now < this.#due - 4 || this.room.isEntered) return;
    // Changed texts make the browser draw as well, so they wait for the next picture of the view. Plots do not wait.
    if (!this.view.isDue(since) && !this.plots.panels.length) return;
    this.#before = now;
    // A late picture does not delay the next ones, so that a slow browser gets as many.
    this.#due = Math.max(this.#due + 1000 / RATE_HZ, now);
    this.#advance(since / 1000);
    this.view.draw(since);
  }

  #advance(seconds) {
    this.playback.step(seconds);
    this.watching.pose(this.live.simulations);
    this.storedSensors.follow();
    this.liveSensors.follow();
    this.strip.follow();
    this.plots.draw();
    this.#showTransport();
  }

  /** What the info board of a room shows, where the page cannot be seen. */
  #facts() {
    const { instance } = this.watching;
    const place = get("connection");
    const throw_ = get("transport").hidden ? "" : get("time").value;
    return {
      title: instance ? `${instance.id}, ${instance.status}` : "nothing runs",
      progress: instance?.progress ? steps(instance.progress) : null,
      outcomes: instance?.progress?.outcomes ?? {},
      lines: [throw_, throw_ && get("values").textContent, this.target.note, get("view-note").textContent, place.dataset.kind === "lost" ? place.textContent : ""],
    };
  }

  #showTransport() {
    const { playing } = this.playback;
    setText(get("play"), playing ? "Pause" : "Play");
    get("play").setAttribute("aria-pressed", String(playing));
    const at = this.view.shown.map((name) => this.playback.at(name)).find(Boolean);
    get("transport").hidden = !at || this.live.simulations.size > 0;
    if (!at) return;
    const scrub = get("scrub");
    scrub.max = at.shown.duration.toFixed(2);
    if (document.activeElement !== scrub || playing) scrub.value = at.time.toFixed(2);
    const { shown, time } = at;
    const { compared } = this.replay;
    const other = compared && shown.simulation === REPLAY && compared.trial !== shown.trial ? `; transparent: trial ${compared.trial}, ${compared.outcome}` : "";
    setText(get("time"), `${time.toFixed(2)} of ${shown.duration.toFixed(2)} s, trial ${shown.trial}, ${shown.outcome}${other}`);
    scrub.setAttribute("aria-valuetext", `${time.toFixed(2)} seconds`);
    setText(get("values"), inWords(shown.values));
  }
}

/** Swept values in words, with short keys. */
function inWords(values) {
  return Object.entries(values).map(([key, value]) => `${key.replace(/^(task|ball|scene)\./, "")} ${Number(value.toPrecision(4))}`).join(", ");
}

function emptiness(instance, problem) {
  if (!instance) return "Nothing runs. Start a component, or look at a run that has ended.";
  if (instance.status === "starting") return `${instance.id} is starting …`;
  if (instance.kind === "container") return `${instance.id} is a container, and has no simulations.`;
  if (lives(instance)) return `${instance.id} has no simulation that is ready yet.`;
  if (problem) return problem;
  if (instance.kind === "session") return `${instance.id} has ended; a session has no dataset whose throws could be replayed.`;
  return `${instance.id} has ended; no throw of it is stored.`;
}

async function begin() {
  const named = readLink();
  let token;
  try {
    token = await takeToken();
  } catch (error) {
    signIn(error.facts?.hint ? `${error.message}; ${error.facts.hint} prints a new address` : error.message);
    return;
  }
  if (token === null) {
    signIn("This page needs a token.");
    return;
  }
  get("page").hidden = false;
  // Tests and curious people reach the page by this name.
  window.throwcollect = new Page(token, named);
}

// If the user opens an address in a tab that has the page already, only the fragment changes.
window.addEventListener("hashchange", () => {
  const link = readLink();
  if (location.hash.includes("code=")) location.reload();
  else if (link.run !== null) window.throwcollect?.open(link);
});

begin();
