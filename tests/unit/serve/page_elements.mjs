// What the parts of the page that have elements do, without a browser. `node --test` runs it; the page's directory is in PAGE.

import assert from "node:assert/strict";
import { test } from "node:test";
import { pathToFileURL } from "node:url";

/** Something that keeps what is set; whatever else is asked of it does nothing. */
const makeFake = (known) => new Proxy(known, { get: (own, name) => (name in own ? own[name] : () => {}) });

/** @type {number[][]} x, y and radius of each arc that was drawn */
const arcs = [];
/** How many lines have been drawn. */
let lines = 0;
/** @type {number[][][]} corners of each polygon that was filled */
const polygons = [];
let corners = [];
const pen = makeFake({
  beginPath: () => {
    corners = [];
  },
  fill: () => corners.length && polygons.push(corners),
  arc: (x, y, radius) => arcs.push([x, y, radius]),
  measureText: () => ({ width: 10 }),
  lineTo: (x, y) => {
    lines += 1;
    corners.push([x, y]);
  },
});

class HTMLElement {}

function makeElement() {
  const acts = new Map();
  return makeFake(Object.assign(new HTMLElement(), {
    style: makeFake({}),
    classList: { contains: () => false, add() {}, remove() {} },
    clientWidth: 0,
    clientHeight: 0,
    textContent: "",
    value: "",
    dataset: {},
    addEventListener: (name, act) => acts.set(name, act),
    click: () => acts.get("click")(),
    change: () => acts.get("change")({ target: get("none") }),
    clickAt: (offsetX, offsetY, shiftKey = false) => acts.get("click")({ offsetX, offsetY, shiftKey }),
    append(...parts) {
      this.textContent += parts.map((part) => part?.textContent ?? part).join("");
    },
    replaceChildren(...parts) {
      this.textContent = parts.map((part) => part.textContent).join(", ");
    },
    getContext: () => pen,
    getBoundingClientRect: () => ({ left: 0, top: 0, width: 0, height: 0 }),
  }));
}

const named = new Map();
/** What the browser keeps from visit to visit. */
const kept = new Map();
/** @type {any[]} all elements that were made, in their order */
const made = [];
const get = (id) => named.get(id) ?? named.set(id, makeElement()).get(id);
const createElement = (tag) => Object.assign(made[made.push(makeElement()) - 1], { tag });
const link = { nodeName: "link", children: [], getAttribute: () => "base" };
const description = { nodeName: "robot", children: [link], getAttribute: () => "robot", querySelector: () => null };

// Newer versions of node have their own, which cannot be set.
globalThis.navigator ??= { language: "en" };
Object.assign(globalThis, {
  window: globalThis,
  document: makeFake({ hidden: false, getElementById: get, createElement }),
  addEventListener() {},
  dispatchEvent() {},
  CustomEvent: Event,
  devicePixelRatio: 1,
  matchMedia: () => makeElement(),
  getComputedStyle: () => makeFake({ color: "black", getPropertyValue: () => "grey" }),
  ResizeObserver: class {
    observe() {}
  },
  Path2D: class {
    constructor() {
      return makeFake({});
    }
  },
  Document: class {},
  location: { hash: "", pathname: "/", search: "" },
  history: {
    replaceState: (_state, _title, address) => {
      location.hash = address.replace(/^[^#]*/, "");
    },
  },
  localStorage: {
    getItem: (key) => kept.get(key) ?? null,
    setItem: (key, value) => kept.set(key, value),
  },
  Element: class {},
  HTMLElement,
  DOMParser: class {
    parseFromString() {
      return { children: [description] };
    }
  },
});

const load = (name) => import(pathToFileURL(`${process.env.PAGE}/${name}`));
const { Watching } = await load("watching.js");
const { Problem } = await load("connection.js");
const { showProblem } = await load("dom.js");
const { LandingMap } = await load("landing_map.js");
const { StoredThrows } = await load("stored_throws.js");
const { PlotPanel } = await load("plot_panel.js");
const { LiveSensors } = await load("live_sensors.js");
const { REPLAY, Replay } = await load("replay.js");
const { RunRecords } = await load("run_records.js");

/** Let everything that waits for nothing but its turn have it. */
const settle = () => new Promise((resolve) => setTimeout(resolve, 5));

/** A view of one run, whose server lacks some answers. */
function watch(lacks) {
  const asked = [];
  const connection = {
    open: () => ({ close() {} }),
    ask: async (_method, path) => {
      const what = path.split("/").at(-1);
      asked.push(what);
      if (lacks.has(what)) throw new Error(`no ${what} for a moment`);
      return { json: async () => ({ base_height_m: 1, target_distance_m: null, bodies: [{ name: "ball", moves: true, above_m: [] }] }), text: async () => "<robot/>" };
    },
  };
  const station = { robot: null, setRobot: (robot) => Object.assign(station, { robot }) };
  const view = makeFake({ stations: new Map([["sim_0", station]]), shown: ["sim_0"] });
  const note = { text: "" };
  const tell = (text) => Object.assign(note, { text });
  const watching = new Watching({ connection, view, playback: makeFake({}), map: makeFake({}), meshes: null, tell });
  const instance = { id: "run", kind: "collection", status: "running", robots: ["sim_0"] };
  const put = async () => {
    watching.put(instance);
    await settle();
  };
  return { watching, station, note, put, asked: () => asked.splice(0) };
}

test("a missing description is asked for again with the next state", async () => {
  for (const what of ["scene", "urdf"]) {
    const lacks = new Set([what]);
    const { watching, station, note, put, asked } = watch(lacks);
    await put();
    assert.equal(station.robot, null);
    assert.equal(note.text, `no ${what} for a moment`);
    assert.deepEqual(asked(), ["scene", "urdf"]);
    lacks.clear();
    await put();
    assert.equal(station.robot?.urdf, "<robot/>", `without ${what} at first`);
    assert.equal(note.text, "");
    assert.deepEqual(asked(), ["scene", "urdf"]);
    await put();
    assert.deepEqual(asked(), []);
    // What comes by rosbridge is drawn from now on.
    watching.describe("sim_0", "<robot>other</robot>");
    assert.equal(station.robot.urdf, "<robot>other</robot>");
  }
});

test("a note about missing parts of a run goes away when nobody watches it", async () => {
  const { watching, note, put } = watch(new Set(["scene", "urdf"]));
  const whole = put();
  watching.put(undefined);
  await whole;
  assert.equal(note.text, "");
});

test("a late answer does not replace the log that was chosen since", async () => {
  const answers = new Map();
  const ask = (_method, path) => new Promise((resolve) => answers.set(path.split("/").at(-1), (text) => resolve({ text: async () => text })));
  const records = new RunRecords({ ask });
  Object.assign(records.element, { open: true, isConnected: true });
  records.put({ id: "run", status: "ended", nodes: [{ name: "sim_0" }] });
  for (const node of ["", "sim_0"]) {
    records.choice.value = node;
    records.choice.change();
  }
  answers.get("sim_0?tail=200")("a line of the log");
  await settle();
  answers.get("events")("");
  await settle();
  assert.equal(records.text.textContent, "a line of the log");
});

/** How many landings are drawn of each third of the ground before the robot, up to the farthest. */
function countThirds(map, farthest) {
  arcs.length = 0;
  const { centre, scale } = map.paint(makeElement(), 300, 600, 1);
  const dots = arcs.filter(([, , radius]) => radius === 2.5).map(([, y]) => centre[0] - (y - 300) / scale);
  return [0, 1, 2].map((third) => dots.filter((x) => Math.min(2, Math.floor((x / farthest) * 3 + 1e-9)) === third).length);
}

test("the map draws an even selection of very many landings", () => {
  const map = new LandingMap(() => {});
  // Every landing is a millimetre farther than the one before; every fourth ball is dropped.
  const throws = Array.from({ length: 80_000 }, (_, i) => (i % 4 ? [i / 1000, 0, "landed", i] : [null, null, "dropped", i]));
  for (let i = 0; i < throws.length; i += 7000) map.addAll(throws.slice(i, i + 7000));
  const thirds = countThirds(map, 80);
  assert.equal(thirds.reduce((sum, count) => sum + count), 15_000);
  thirds.forEach((count) => assert.ok(Math.abs(count - 5000) < 5, `${thirds} are not even`));
  assert.match(get("map-text").textContent, /^15000 of 60000 landings so far: 0\.00 to 80\.00 m before the robot, /);
  assert.equal(get("legend").textContent, "landed 60000, dropped 20000");
  map.add({ trial: 0, outcome: "dropped", landing: null });
  assert.equal(get("legend").textContent, "landed 60000, dropped 20000");
  map.clear();
  assert.equal(get("legend").textContent, "");
  map.addAll(throws.slice(0, 12));
  assert.match(get("map-text").textContent, /^9 landings so far: /);
  assert.equal(countThirds(map, 0.012).reduce((sum, count) => sum + count), 9);
  map.put(throws.slice(1, 3), 4, { landed: 4, dropped: 1 });
  assert.match(get("map-text").textContent, /^2 of 4 landings of all throws: /);
  assert.equal(get("legend").textContent, "landed 4, dropped 1");
});

/** Columns of throws, as the server gives them; each row has x, y, outcome and trial. */
const toColumns = (rows, facts) => ({
  trial: rows.map((row) => row[3]), outcome: rows.map((row) => row[2]), x_m: rows.map((row) => row[0]), y_m: rows.map((row) => row[1]),
  values: {}, counts: {}, total: rows.length, noun: "throw", end: "landing", success: "landed", following: 0, is_finished: true, has_more: false, ...facts,
});

/** Throws of a run, as the server gives them; what it answers can be changed. */
function follow() {
  const map = new LandingMap(() => {});
  const server = { answer: async () => null };
  const asked = [];
  const read = async (_method, path) => {
    asked.push(path);
    return server.answer();
  };
  const landings = new StoredThrows({ read }, map);
  landings.begin("run");
  const put = async (facts) => {
    landings.follow({ id: "run", kind: "collection", status: "ended", progress: { ended: 3 }, summary: null, ...facts });
    await settle();
  };
  return { landings, server, put, asked };
}

test("the legend of a finished dataset counts all throws, also those that are not on the map", async () => {
  const { landings, server, put } = follow();
  const found = toColumns([[1, 0, "landed", 0], [2, 0, "landed", 2]], { total: 4, counts: { landed: 4, dropped: 7 } });
  server.answer = async () => found;
  await put({ summary: {} });
  assert.equal(get("legend").textContent, "dropped 7, landed 4");
  landings.begin("run");
  server.answer = async () => toColumns([], { counts: { dropped: 7 } });
  await put({ summary: {} });
  assert.equal(get("legend").textContent, "dropped 7");
  assert.equal(get("map-text").textContent, "None of these throws has landed.");
  landings.begin(null);
});

test("the grid of the map has some lines, however far away a target is", () => {
  const map = new LandingMap(() => {});
  for (const away of [0, 3, 30, 300, 1e6, 1e12]) {
    map.choose([away, 0, 0]);
    lines = 0;
    map.paint(makeElement(), 300, 300, 1);
    assert.ok(lines > 4 && lines < 40, `${lines} lines at ${away} m`);
  }
});

test("the map has the outlines of bodies: those of the throw that is marked, if they are known", () => {
  const map = new LandingMap(() => {});
  const outlines = () => {
    polygons.length = 0;
    const { centre, scale } = map.paint(makeElement(), 300, 300, 1);
    return polygons.map((each) => each.map(([x, y]) => [centre[0] - (y - 150) / scale, centre[1] - (x - 150) / scale].map((value) => Math.round(value * 100) / 100)));
  };
  const square = (x, y, size) => [[x, y], [x + size, y], [x + size, y + size], [x, y + size]];
  map.surround([{ above_m: square(1.5, -0.5, 0.4), color: "#8a6f4d" }]);
  assert.deepEqual(outlines(), [[[1.5, -0.5], [1.9, -0.5], [1.9, -0.1], [1.5, -0.1]]]);
  map.mark({ landing: null, bodies: null });
  assert.equal(outlines()[0][0][0], 1.5);
  map.mark({ landing: null, bodies: [{ above_m: square(2, 1, 0.5), color: "#8a6f4d" }] });
  assert.deepEqual(outlines(), [square(2, 1, 0.5)]);
  // A hall does not make everything else tiny.
  map.mark({ landing: null, bodies: [{ above_m: square(-20, -20, 40), color: "#8a6f4d" }] });
  assert.ok(map.paint(makeElement(), 300, 300, 1).scale > 40);
  map.clear();
  assert.deepEqual(outlines(), []);
});

test("a throw stands between the bodies of its own trial", async () => {
  const { watching, station, put } = watch(new Set());
  await put();
  station.trails = makeFake({});
  station.bodies = { put: (bodies) => Object.assign(station, { stood: bodies }) };
  const bodies = [{ name: "post" }];
  watching.begin({ simulation: "sim_0", bodies });
  assert.equal(station.stood, bodies);
});

test("the map draws a single landing among very many dropped throws", () => {
  const map = new LandingMap(() => {});
  map.addAll(Array.from({ length: 30_000 }, (_, i) => [null, null, "dropped", i]));
  assert.equal(get("map-text").textContent, "None of these throws has landed.");
  map.addAll([[1, 0, "landed", 30_001]]);
  assert.match(get("map-text").textContent, /^1 landing so far: 1\.00 to 1\.00 m/);
  assert.equal(get("legend").textContent, "dropped 30000, landed 1");
});

test("the page asks again for landings after a lost connection", async () => {
  const { landings, server, put, asked } = follow();
  const summary = {};
  for (const facts of [{ summary }, { summary: null }]) {
    asked.splice(0);
    landings.begin("run");
    server.answer = async () => {
      throw new Problem(0, {});
    };
    await put(facts);
    server.answer = async () => toColumns([[1, 0, "landed", 0]], { counts: { landed: 1 }, following: 9 });
    // It asks by itself, after two seconds.
    await new Promise((resolve) => setTimeout(resolve, 2100));
    assert.equal(asked.length, 2);
    assert.match(get("map-text").textContent, /^1 landings? of all throws/);
  }
  landings.begin(null);
});

test("a single problem is shown once, and several problems are all shown", () => {
  const place = makeElement();
  const one = { key: "trials", message: "should be above 0" };
  showProblem(place, new Problem(422, { title: "trials: should be above 0", problems: [one] }));
  assert.equal(place.textContent, "trials: should be above 0");
  place.textContent = "";
  const other = { key: null, message: "no such file" };
  showProblem(place, new Problem(422, { title: "a.yaml:2: trials: should be above 0\nno such file", problems: [one, other] }));
  assert.equal(place.textContent, "a.yaml:2: trials: should be above 0no such file");
  place.textContent = "";
  showProblem(place, new Problem(422, { title: "the request is wrong", problems: [one, other], hint: "ask" }));
  assert.equal(place.textContent, "the request is wrongtrials: should be above 0no such filetry: ask");
});

test("a zoom of a replay stays from throw to throw, and one of live values ends with the live view", async () => {
  const panel = new PlotPanel({ simulation: "sim_0", field: "ball", name: "z", link: "hand" }, false, () => {});
  const zoomIn = made.find(({ textContent }) => textContent === "+");
  const makeThrow = (trial) => ({
    trial, simulation: "sim_0", joints: [], samples: 201, rate_hz: 100, duration: 2, positions: new Float32Array(), path: new Float32Array(603),
  });
  /** Where the middle of a replay is in the plot, and how far it is from there to its end. */
  const measure = async (shown) => {
    const at = [];
    for (const time of [1, 2]) {
      panel.draw({ shown, time }, null);
      await settle();
      at.push(panel.picture.at);
    }
    return [at[0], at[1] - at[0]];
  };
  const [middle, half] = await measure(makeThrow(1));
  assert.ok(half > 10);
  panel.draw(undefined, [{ time: 1, ball: [0, 0, 1] }, { time: 2, ball: [0, 0, 2] }]);
  await settle();
  zoomIn.click();
  assert.deepEqual(await measure(makeThrow(2)), [middle, half]);
  zoomIn.click();
  await settle();
  assert.deepEqual(await measure(makeThrow(3)), [middle, 2 * half]);
});

/** A map of four throws of slides, of which one missed the puck. */
function makeMap(pick = () => {}, choose = () => {}) {
  const map = new LandingMap(choose, pick);
  map.clear();
  map.know({ noun: "slide", end: "rest", success: "at_rest", values: { speed: [] } });
  map.put([[1, 0, "at_rest", 0, { speed: 1 }], [null, null, "missed_puck", 1, { speed: 2 }], [2, 0, "at_rest", 2, { speed: 3 }], [3, 0, "at_rest", 5, { speed: 4 }]], 3, { at_rest: 3, missed_puck: 1 });
  return map;
}

const setFilter = (key, min, max) => {
  [["key", key], ["min", min], ["max", max]].forEach(([name, value]) => Object.assign(get(`filter-${name}`), { value }));
};

test("a click on a landing replays its throw, and one elsewhere or with Shift sets the target", () => {
  const picked = [];
  const places = [];
  const map = makeMap((trial) => picked.push(trial), (...place) => places.push(place));
  Object.assign(map.canvas, { clientWidth: 300, clientHeight: 300 });
  const { centre, scale } = map.paint(makeElement(), 300, 300, 1);
  const at = [150 - (0 - centre[1]) * scale, 150 - (2 - centre[0]) * scale];
  map.canvas.clickAt(at[0] + 3, at[1]);
  map.canvas.clickAt(at[0] + 40, at[1]);
  map.canvas.clickAt(at[0], at[1], true);
  assert.deepEqual(picked, [2]);
  assert.deepEqual(places.map(([x]) => x.toFixed(3)), ["2.000", "2.000"]);
  Object.assign(map.canvas, { clientWidth: 0, clientHeight: 0 });
});

test("the map speaks of what its task does, and shows what passes the filter", () => {
  const map = makeMap();
  assert.equal(get("map-title").textContent, "Map of rests");
  assert.match(get("map-text").textContent, /^3 rests of all slides: 1\.00 to 3\.00 m/);
  setFilter("speed", "2", "");
  map.refresh();
  assert.match(get("map-text").textContent, /^2 of 3 rests of all slides: 2\.00 to 3\.00 m/);
  assert.deepEqual(map.list.ordered.filter(map.filter.accepts).map((row) => row[3]), [1, 2, 5]);
  map.filter.toggle("at_rest");
  assert.equal(get("map-text").textContent, "No rest passes the filter.");
  assert.equal(get("legend").textContent, "at_rest 3, missed_puck 1");
  map.filter.toggle("at_rest");
  setFilter("", "", "");
  map.put([], 0, {});
  assert.equal(get("map-text").textContent, "No rest yet.");
});

/** A replay of a run, and what it asked for and drew. */
function makeReplay(map, answer) {
  const asked = [];
  const shown = [];
  const notes = [];
  const connection = {
    ask: async (_method, path) => {
      const trial = Number(path.split("/").at(-1));
      asked.push(trial);
      return { arrayBuffer: () => answer(trial) };
    },
  };
  const playback = { show: ({ trial, simulation }) => shown.push([trial, simulation]) };
  const replay = new Replay({ connection, view: makeFake({ stations: new Map() }), playback, map, tell: (text) => notes.push(text), changed: () => {} });
  replay.begin("run-1");
  return { replay, asked, shown, notes };
}

/** A message with a throw of one sample, without joints. */
function encode(trial) {
  const text = new TextEncoder().encode(JSON.stringify({ trial, outcome: "at_rest", joints: [], samples: 1, rate_hz: 100, landing: null, values: {} }));
  const start = 4 + Math.ceil(text.length / 4) * 4;
  const bytes = new Uint8Array(start + 40);
  new DataView(bytes.buffer).setUint32(0, text.length, true);
  bytes.set(text, 4);
  return bytes.buffer;
}

test("stored throws follow each other as the filter has them, and the address leads back to each", async () => {
  const map = makeMap();
  const { replay, asked, shown } = makeReplay(map, async (trial) => encode(trial));
  replay.step(1);
  await settle();
  replay.compare();
  setFilter("speed", "3", "");
  replay.step(1);
  await settle();
  assert.deepEqual(shown, [[0, REPLAY], [2, REPLAY]]);
  assert.equal(location.hash, "#run=run-1&trial=2&compared=0");
  assert.equal(get("stored-count").textContent, "2 of 4 slides");
  replay.step(1);
  await settle();
  assert.deepEqual([get("stored-before").disabled, get("stored-after").disabled], [false, true]);
  replay.step(1);
  await settle();
  assert.deepEqual(asked, [0, 2, 5]);
  setFilter("", "", "");
  // Another visit compares with the same throw.
  assert.deepEqual(JSON.parse(kept.get("throwcollect.layout")).compared, { run: "run-1", trial: 0 });
  const later = makeReplay(map, async (trial) => encode(trial));
  await settle();
  assert.equal(later.replay.compared.trial, 0);
  replay.leave();
  assert.equal(location.hash, "");
  kept.clear();
});

test("a throw that comes late does not replace one that was chosen since, and a missing one is named", async () => {
  const answers = new Map();
  const { replay, shown, notes } = makeReplay(makeMap(), (trial) => new Promise((resolve, reject) => answers.set(trial, { resolve, reject })));
  for (const trial of [0, 2, 7]) replay.show(trial);
  await settle();
  answers.get(2).resolve(encode(2));
  answers.get(0).resolve(encode(0));
  answers.get(7).reject(new Error("trial 7 has no episode"));
  await settle();
  assert.deepEqual([shown, notes], [[], ["trial 7 has no episode"]]);
  replay.leave();
});

/** The sensors of sim_0, shown in a strip that keeps what it is given. */
function showLiveSensors() {
  const topics = new Map();
  const sent = [];
  const answers = [];
  const notes = [];
  const live = {
    simulations: new Set(),
    call: (_service, _type, { parameters }) => {
      sent.push(JSON.parse(parameters[0].value.string_value));
      return new Promise((resolve) => answers.push((result) => resolve({ results: [result] })));
    },
    subscribe: (topic, _type, hear) => topics.set(topic, hear),
    unsubscribe: (topic) => topics.delete(topic),
  };
  const strip = {
    strands: [], sensors: [], source: null,
    tell: (text) => notes.push(text),
    put(source, sensors) {
      Object.assign(this, { source, sensors, strands: sensors.map((sensor) => ({ sensor, stream: "color" })) });
    },
  };
  const sensors = new LiveSensors({ live, strip });
  const follow = (...names) => {
    live.simulations = new Set(names);
    sensors.follow();
  };
  const hear = (sections) => topics.get("/sim_0/sensors")({ data: JSON.stringify(Object.entries(sections).map(([name, section]) => ({ name, section }))) });
  return { answers, follow, hear, notes, sensors, sent, strip, topics, button: document.getElementById("show-sensors") };
}

test("pictures are subscribed to only while the strip of a simulation is open", () => {
  const { follow, hear, strip, topics, button } = showLiveSensors();
  follow("sim_0");
  assert.deepEqual([button.hidden, topics.size], [false, 0]);
  button.click();
  assert.deepEqual([...topics.keys()], ["/sim_0/sensors"]);
  hear({ head: {}, side: {} });
  hear({ side: {}, camera: {} });
  assert.deepEqual([...topics.keys()], ["/sim_0/sensors", "/sim_0/side/image_raw", "/sim_0/camera/image_raw"]);
  button.click();
  assert.deepEqual([topics.size, strip.source], [0, null]);
  button.click();
  follow("sim_0", "sim_1");
  assert.deepEqual([topics.size, button.hidden], [0, true]);
});

test("while the node of the sensors changes them, only the newest change waits", async () => {
  const { answers, follow, hear, notes, sensors, sent, button } = showLiveSensors();
  follow("sim_0");
  button.click();
  hear({ head: { width: 8 }, side: { width: 8 } });
  for (const width of [16, 24, 32]) sensors.change("head", { width });
  assert.deepEqual(sent, [{ head: { width: 16 }, side: { width: 8 } }]);
  // What the node says meanwhile does not undo what waits.
  hear({ head: { width: 16 }, side: { width: 8 } });
  answers.shift()({ successful: true });
  await settle();
  assert.deepEqual(sent.at(-1), { head: { width: 32 }, side: { width: 8 } });
  answers.shift()({ successful: true });
  await settle();
  hear({ head: { width: 32 }, side: { width: 8 } });
  sensors.change("side", null);
  assert.deepEqual(sent.slice(2), [{ head: { width: 32 } }]);
  answers.shift()({ successful: false, reason: "sensors.side: no" });
  await settle();
  assert.equal(notes.at(-1), "sensors.side: no");
  sensors.change("camera", { width: 8 });
  assert.deepEqual(sent.at(-1), { head: { width: 32 }, side: { width: 8 }, camera: { width: 8 } });
});
