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
    addEventListener: (name, act) => acts.set(name, act),
    click: () => acts.get("click")(),
    change: () => acts.get("change")(),
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
const { Landings } = await load("landings.js");
const { PlotPanel } = await load("plot_panel.js");
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

/** Landings of a run, as the server gives them; what it answers can be changed. */
function follow() {
  const map = new LandingMap(() => {});
  const server = { answer: async () => null };
  const asked = [];
  const read = async (_method, path) => {
    asked.push(path);
    return server.answer();
  };
  const landings = new Landings({ read }, map);
  landings.begin("run");
  const put = async (facts) => {
    landings.follow({ id: "run", kind: "collection", status: "ended", progress: { ended: 3 }, summary: null, ...facts });
    await settle();
  };
  return { landings, server, put, asked };
}

test("the legend of a finished dataset counts all throws, also those that are not on the map", async () => {
  const { landings, server, put } = follow();
  const found = { landings: [[1, 0, "landed", 0], [2, 0, "landed", 2]], total: 4, outcomes: { landed: 4, dropped: 7 }, following: 0, is_finished: true, has_more: false };
  server.answer = async () => found;
  await put({ summary: {} });
  assert.equal(get("legend").textContent, "dropped 7, landed 4");
  landings.begin("run");
  server.answer = async () => ({ ...found, landings: [], total: 0, outcomes: { dropped: 7 } });
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
  watching.begin({ simulation: "sim_0", bodies: null });
  assert.equal(station.stood, bodies);
});

test("the map draws a single landing among very many dropped throws", () => {
  const map = new LandingMap(() => {});
  map.addAll(Array.from({ length: 30_000 }, (_, i) => [null, null, "dropped", i]));
  assert.equal(get("map-text").textContent, "None of these throws has landed.");
  map.addAll([[1, 0, "landed", 30_001]]);
  assert.match(get("map-text").textContent, /^1 landings so far: 1\.00 to 1\.00 m/);
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
    server.answer = async () => ({ landings: [[1, 0, "landed", 0]], total: 1, outcomes: { landed: 1 }, following: 9, is_finished: true, has_more: false });
    // It asks by itself, after two seconds.
    await new Promise((resolve) => setTimeout(resolve, 2100));
    assert.equal(asked.length, 2);
    assert.match(get("map-text").textContent, /^1 landings of all throws/);
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
