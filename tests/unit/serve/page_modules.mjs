// What modules of the page compute, without a browser. `node --test` runs it; the page's directory is in PAGE.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { pathToFileURL } from "node:url";

const load = (name) => import(pathToFileURL(`${process.env.PAGE}/${name}`));
const { decodeThrow, jointsAt, posesAt, seriesOf, widestJoint } = await load("throws.js");
const { Playback } = await load("playback.js");
const { inOrder, lives, steps, watchable } = await load("state.js");
const { readChanges } = await load("controls.js");
const { coarsen } = await load("coarse.js");
const { placeApart } = await load("places.js");
const { describeModel } = await load("model_map.js");
const { describe, median, tabulate } = await load("model_words.js");
const { Rosbridge } = await load("rosbridge.js");
const { Bodies } = await load("bodies.js");
const { addSuccess, colorOf } = await load("outcomes.js");
const { aimAlong, anglesTo, frameAt, linesOf, paint, pointsOf, rpyOf, toYaml } = await load("sensor_frames.js");
const { paintImage } = await load("live_sensors.js");
const { SensorMarks } = await load("sensor_marks.js");
const { BoxGeometry, Euler, Matrix4, Quaternion, SphereGeometry, Vector3 } = await load("vendor/three/build/three.module.js");

const bytes = readFileSync(process.env.THROW);
const thrown = () => decodeThrow(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
const near = (a, b) => assert.ok(Math.abs(a - b) < 1e-6, `${a} is not ${b}`);

test("decodeThrow restores an encoded throw", () => {
  const { trial, outcome, joints, samples, duration, landing } = thrown();
  assert.deepEqual({ trial, outcome, joints, samples, landing }, {
    trial: 7, outcome: "landed", joints: ["elbow", "wrist"], samples: 3, landing: [1.5, -0.25, 0],
  });
  near(duration, 0.02);
});

test("joints are interpolated between two samples", () => {
  jointsAt(thrown(), 0.005).forEach((value, i) => near(value, [0.5, 10.5][i]));
  assert.deepEqual(jointsAt(thrown(), 99), [2, 12]);
  assert.deepEqual(jointsAt(thrown(), -1), [0, 10]);
});

test("bodies that move are where they were at the sample before", () => {
  const rows = [[0, 0, 1, 0, 0, 0, 1], [0.5, 0, 1, 0, 0, 1, 0]];
  const shown = { samples: 2, rate_hz: 10, moved: new Float32Array(rows.flat()) };
  assert.deepEqual(posesAt(shown, 0.09), [rows[0]]);
  assert.deepEqual(posesAt(shown, 9), [rows[1]]);
  posesAt(thrown(), 0.015)[0].slice(0, 3).forEach((value, i) => near(value, [1, 2, 3][i]));
  const bodies = new Bodies();
  const look = { shape: "box", size_m: [1, 1, 1], position_m: [3, 0, 0], rpy_rad: [0, 0, 0], color: "#ffffff" };
  bodies.put([{ ...look, name: "wall", moves: false }, { ...look, name: "can", moves: true }]);
  bodies.move(posesAt(shown, 0.1));
  const [wall, can] = bodies.object.children;
  assert.deepEqual([wall.position.x, can.position.x, can.quaternion.z], [3, 0.5, 1]);
});

test("a panel goes to the nearest place where it covers no other one", () => {
  const stage = { most: 500, lowest: 300 };
  const box = { left: 100, top: 4, width: 200, height: 100 };
  assert.deepEqual(placeApart(box, [], stage), { left: 100, top: 4 });
  const first = { ...box, left: 120 };
  assert.deepEqual(placeApart(box, [first], stage), { left: 100, top: 108 });
  const second = { ...box, top: 108 };
  assert.deepEqual(placeApart(box, [first, second], stage), { left: 100, top: 212 });
  assert.deepEqual(placeApart(box, [first], { most: 500, lowest: 50 }), { left: 324, top: 4 });
  assert.equal(placeApart(box, [first], { most: 150, lowest: 50 }), null);
  assert.deepEqual(placeApart(box, [], { most: 50, lowest: 0 }), { left: 100, top: 4 });
});

test("velocities come from positions, and there is no series of efforts", () => {
  seriesOf(thrown(), "velocity", "wrist").forEach((value) => near(value, 100));
  assert.deepEqual([...seriesOf(thrown(), "ball", "z")], [2, 3, 4]);
  assert.equal(seriesOf(thrown(), "effort", "wrist"), null);
  assert.equal(seriesOf(thrown(), "position", "knee"), null);
});

test("the widest joint is the one that moves most, not the one with the largest positions", () => {
  const positions = Float32Array.from([0, 10, 0.5, 10.1, 1, 10.2]);
  assert.equal(widestJoint({ ...thrown(), positions }), "elbow");
  assert.equal(widestJoint({ ...thrown(), positions: positions.map((each, i) => each * (i % 2 ? 9 : 1)) }), "wrist");
});

test("a newer throw waits for the end of the one that is shown", () => {
  const began = [];
  const playback = new Playback(({ trial }) => began.push(trial));
  const made = (trial) => ({ ...thrown(), trial, simulation: "sim_0", duration: 1 });
  playback.put(made(1));
  playback.step(0.1);
  playback.put(made(2));
  playback.put(made(3));
  playback.step(0.1);
  near(playback.at("sim_0").time, 0.2);
  for (let i = 0; i < 9; i++) playback.step(0.2);
  assert.deepEqual(began, [1, 3]);
});

test("a slow replay takes longer, and a replay that was moved by hand stands still", () => {
  const playback = new Playback(() => {});
  playback.put({ ...thrown(), simulation: "sim_0", duration: 1 });
  playback.speed = 0.1;
  playback.step(0.2);
  near(playback.at("sim_0").time, 0.02);
  playback.seek(0.5);
  playback.step(0.2);
  near(playback.at("sim_0").time, 0.5);
});

test("the progress of a collection until enough successes counts successes", () => {
  const progress = { ended: 30, total: 100, outcomes: { landed: 12, dropped: 18 }, wanted: null, success: "landed" };
  assert.deepEqual(steps(progress), [30, 100]);
  assert.deepEqual(steps({ ...progress, wanted: 10 }), [10, 10]);
});

test("simulations are sorted by their numbers", () => {
  assert.deepEqual(inOrder(["sim_10", "sim_2", "sim_1"]), ["sim_1", "sim_2", "sim_10"]);
});

test("changed keys are read line by line, and a bad line is named", () => {
  assert.deepEqual(readChanges("trials: 50\n\nname = mine\nsim.real_time_factor: 1.5"), { trials: 50, name: "mine", "sim.real_time_factor": 1.5 });
  assert.throws(() => readChanges("trials: 5\nwhat"), /line 2: .*'what'/);
});

test("a topic is advertised once for each connection, and a refusal is reported", () => {
  const sent = [];
  const told = [];
  let events;
  const connection = { openRosbridge: (_run, given) => {
    events = given;
    return { send: (text) => sent.push(JSON.parse(text)) };
  } };
  const bridge = new Rosbridge(connection, "run", { refused: (text) => told.push(text) });
  assert.throws(() => bridge.publish("/target", "geometry_msgs/msg/PointStamped", {}), /no connection/);
  events.opened();
  bridge.publish("/target", "geometry_msgs/msg/PointStamped", { a: 1 });
  bridge.publish("/target", "geometry_msgs/msg/PointStamped", { a: 2 });
  assert.deepEqual(sent.map(({ op, latch, msg }) => [op, latch ?? msg.a]), [["advertise", true], ["publish", 1], ["publish", 2]]);
  events.lost();
  events.opened();
  assert.equal(sent.at(-1).op, "advertise");
  events.receive(JSON.stringify({ op: "status", level: "error", id: sent.at(-1).id, msg: "may only look" }));
  events.receive(JSON.stringify({ op: "status", level: "warning", id: sent.at(-1).id, msg: "slow" }));
  events.receive(JSON.stringify({ op: "status", level: "error", id: "other", msg: "other" }));
  assert.deepEqual(told, ["may only look"]);
});

test("a call gets its answer, the reason of its failure, or the loss of the connection", async () => {
  const sent = [];
  let events;
  const bridge = new Rosbridge({ openRosbridge: (_run, given) => {
    events = given;
    return { send: (text) => sent.push(JSON.parse(text)) };
  } }, "run");
  const call = () => bridge.call("/sim_0/record", "std_srvs/srv/SetBool", { data: true });
  await assert.rejects(call, /no connection/);
  events.opened();
  const answers = [call(), call(), call(), call()];
  assert.equal(new Set(sent.map(({ id }) => id)).size, 4);
  const answer = (i, rest) => events.receive(JSON.stringify({ op: "service_response", id: sent[i].id, ...rest }));
  answer(1, { result: false, values: "no such service" });
  answer(0, { result: true, values: { success: true, message: "records" } });
  events.receive(JSON.stringify({ op: "status", level: "error", id: sent[2].id, msg: "may only look" }));
  events.lost();
  assert.equal((await answers[0]).message, "records");
  await assert.rejects(answers[1], /no such service/);
  await assert.rejects(answers[2], /may only look/);
  await assert.rejects(answers[3], /connection to the run is lost/);
});

test("a coarse mesh keeps its extent with fewer triangles, and edges stay sharp", () => {
  const sphere = new SphereGeometry(1, 64, 32);
  const coarse = coarsen(sphere, 0.3);
  assert.ok(coarse.index.count < sphere.index.count / 4);
  coarse.computeBoundingBox();
  assert.ok(coarse.boundingBox.max.x > 0.8 && coarse.boundingBox.max.x <= 1);
  const box = coarsen(new BoxGeometry(1, 1, 1), 0.4);
  assert.equal(box.index.count, 36);
  assert.ok(box.getAttribute("position").count > 8);
  // Each side of a box has a material of its own.
  assert.deepEqual(box.groups.map(({ start, count, materialIndex }) => [start, count, materialIndex]), [0, 1, 2, 3, 4, 5].map((side) => [6 * side, 6, side]));
});

test("a run counts as living while it is starting or running", () => {
  const statuses = ["starting", "running", "ended", "died"];
  assert.deepEqual(statuses.map((status) => lives({ status })), [true, true, false, false]);
});

test("a container can be watched only if the address names it", () => {
  const runs = [["ear", "container", "running"], ["talos", "session", "running"], ["old", "collection", "ended"]];
  const instances = runs.map(([id, kind, status]) => ({ id, kind, status }));
  assert.deepEqual(watchable(instances, [null]), ["talos"]);
  assert.deepEqual(watchable(instances, ["old", "ear"]), ["ear", "talos", "old"]);
});

test("a model is described in sentences, before and after it was adapted", () => {
  const model = {
    learned_from: "quick", throws: 1021, error: 0.0021, parameters: ["task.duration_s"], targets: ["landing_x_m", "landing_y_m"],
    adaptation: null, score: null,
  };
  assert.match(describe(model), /1021 throws of quick: task.duration_s to landing_x_m, landing_y_m\. .* 0\.21 cm \(median\)\. Nobody/);
  assert.match(describe({ ...model, targets: [...model.targets, "hit_angle_rad"] }), /predicted to 0\.0021 \(over targets of several units\) \(median\)/);
  assert.match(describe({ ...model, targets: ["hit_angle_rad"] }), /predicted to 0\.12° \(median\)/);
  const adaptation = { method: "bias", throws: 3, before: [0.1, 0.2, 0.3], after: [0.01, 0.03, 0.02], found: [{ name: "task.duration_s", value: 0.01234, deviation: 0.001 }] };
  assert.match(describe({ ...model, adaptation }), /by 3 throws \(bias\): .* 20\.00 cm .* before, and 2\.00 cm after.* task\.duration_s 0\.0123 ± 0\.001\./);
  assert.match(describe({ ...model, adaptation: { ...adaptation, throws: 1, before: [0.1], after: [] } }), /by 1 throw \(bias\): .* 10\.00 cm from their prediction before \(median\)/);
});

test("errors of a score become rows, first those in the own world, then those in another one", () => {
  const errors = { unit: "m", median: 0.01, share90: 0.02, largest: null, others: [] };
  const rows = tabulate({ trained: [{ trained_on: 30, errors }], adapted: [{ real_throws: 0, method: "none", errors }, { real_throws: 1, method: "offset", errors }] });
  assert.deepEqual(rows.map(([text]) => text), ["learned from 30 throws", "other world, not adapted", "other world, 1 throw there (offset)"]);
  assert.deepEqual(rows[0].slice(1), ["1.00\u00a0cm", "2.00\u00a0cm", "–"]);
  const [, second] = tabulate({ trained: [{ trained_on: 30, errors }], distilled: errors, adapted: [] });
  assert.deepEqual(second, ["model.onnx of these", "1.00\u00a0cm", "2.00\u00a0cm", "–"]);
});

test("the median is the mean of the middle two where there is no middle one", () => {
  assert.deepEqual([[], [3], [4, 1], [9, 1, 5, 2], [3, 1, 2]].map(median), [null, 3, 2.5, 3.5, 2]);
});

test("misses are shown in the unit of their targets", () => {
  const angle = { unit: "rad", median: Math.PI / 180, share90: Math.PI / 90, largest: null, others: [] };
  const several = { unit: "m", median: 0.01, share90: 0.02, largest: null, others: [angle, { unit: "s", median: 0.5, share90: 1, largest: null }] };
  const rows = tabulate({ trained: [{ trained_on: 30, errors: angle }, { trained_on: 60, errors: several }], adapted: [] });
  assert.deepEqual(rows[0].slice(1), ["1.00°", "2.00°", "–"]);
  assert.deepEqual(rows[1].slice(1), ["1.00\u00a0cm, 1.00°, 0.5\u00a0s", "2.00\u00a0cm, 2.00°, 1\u00a0s", "–"]);
});

test("the landings that are drawn of a model are also described in words", () => {
  assert.equal(describeModel(null), "");
  const throws = [{ target: [1, 0], place: [1, 0.01] }, { target: [1, 1], place: null }];
  assert.match(describeModel({ name: "quick", reached: [[1, 0]], throws }), /^Grey: 1 .* quick .* 2 targets, .* 10 times as long; at 1 of them no throw landed\.$/);
});

test("bodies stand where the scene has them, and new ones take their place", () => {
  const bodies = new Bodies();
  const turn = [Math.PI / 2, 0, Math.PI / 2];
  const common = { position_m: [1, 2, 3], rpy_rad: turn, size_m: [0.2, 0.4, 0.6], color: "#ff0000" };
  bodies.put([{ ...common, name: "post", shape: "cylinder" }, { ...common, name: "box", shape: "box" }]);
  const [post, box] = bodies.object.children;
  bodies.object.updateMatrixWorld();
  // The turn about x lays the axis of the cylinder along y, and that about z then along x.
  const top = post.localToWorld(new Vector3(0, 0, 0.5));
  top.toArray().forEach((value, i) => near(value, [1.3, 2, 3][i]));
  post.geometry.computeBoundingBox();
  post.geometry.boundingBox.max.toArray().forEach((value) => near(value, 0.5));
  assert.equal(box.material.color.getHexString(), "ff0000");
  bodies.put([{ ...common, name: "ball", shape: "sphere", moves: true }]);
  const [ball] = bodies.object.children;
  assert.deepEqual([ball.name, ball.scale.x, ball.visible], ["ball", 0.08, false]);
  bodies.place("ball", [1, 2, 4, 0, 0, 0, 1]);
  assert.deepEqual([ball.position.z, ball.visible], [4, true]);
});

test("each outcome has a colour of its own, and every success the same", () => {
  const throws = ["landed", "dropped", "not_released", "recaught", "self_hit", "body_hit", "limit_violated", "timeout", "tracking_failed", "lost"];
  const names = [...throws, "wall_hit", "rim_hit", "bounced_out", "short", "beyond"];
  assert.equal(new Set(names.map(colorOf)).size, names.length);
  addSuccess("in_bin");
  assert.equal(colorOf("in_bin"), colorOf("landed"));
});

test("the frame of a time is the newest one, and none before there is one", () => {
  assert.deepEqual([-1, 0, 0.09, 0.1 - 1e-9, 0.15, 9].map((time) => frameAt([0, 0.1, 0.2], time)), [0, 0, 0, 1, 1, 2]);
  assert.equal(frameAt([], 1), -1);
});

test("pictures are painted: colors as they are, depths as grey, labels in colors that differ", () => {
  assert.deepEqual([...paint("color", Uint8Array.from([1, 2, 3, 4, 5, 6]).buffer, 2)], [1, 2, 3, 255, 4, 5, 6, 255]);
  assert.deepEqual([...paint("depth", Float32Array.from([1, 3, Infinity]).buffer, 3)].filter((_, i) => i % 4 === 0), [255, 55, 0]);
  assert.deepEqual([...paint("depth", Float32Array.from([2]).buffer, 1)], [255, 255, 255, 255]);
  const painted = paint("segmentation", Uint16Array.from([0, 1, 2, 1]).buffer, 4);
  const [nothing, one, two, again] = [0, 4, 8, 12].map((at) => painted.slice(at, at + 3).join());
  assert.equal(nothing, "0,0,0");
  assert.equal(one, again);
  assert.equal(new Set([nothing, one, two]).size, 3);
});

test("points are where rays ended, in the frame of the sensor", () => {
  const scan = { streams: ["scan"], section: { from_rad: -Math.PI, to_rad: Math.PI } };
  [-1, 0, 0, 0, 2, 0].forEach((value, i) => near(pointsOf(scan, Float32Array.from([1, Infinity, Infinity, 2]).buffer)[i], value));
  const part = { streams: ["scan"], section: { from_rad: 0, to_rad: Math.PI / 2 } };
  [3, 0, 0, 0, 4, 0].forEach((value, i) => near(pointsOf(part, Float32Array.from([3, 4]).buffer)[i], value));
  const cloud = { streams: ["points"], section: {} };
  assert.deepEqual([...pointsOf(cloud, Float32Array.from([1, 2, 3, 7, NaN, NaN, NaN, 0, 4, 5, 6, 7]).buffer)], [1, 2, 3, 4, 5, 6]);
});

test("lines of a view go from the eye to the corners of its pictures", () => {
  const lines = linesOf({ section: { width: 20, height: 10, vertical_fov_rad: Math.PI / 2 } });
  assert.deepEqual([...lines.slice(0, 3)], [0, 0, 0]);
  // Twice as wide as high: 45 degrees up, and y twice as far as x.
  [0.25, 0.5, 0.25].forEach((value, i) => near(lines[3 + i], value));
});

test("lines follow the link of a sensor, and points stay where they were seen", () => {
  const marks = new SensorMarks();
  const sensor = { name: "head", position_m: [0, 0, 1], rotation_xyzw: [0, 0, 0, 1], section: { link: "head_link", width: 8, height: 8, vertical_fov_rad: 1 } };
  const robotAt = (x) => ({ poseOf: (link) => (link === "head_link" ? new Matrix4().makeTranslation(x, 0, 0) : null) });
  marks.put([sensor]);
  const [lines, points] = marks.object.children;
  marks.setPoints("head", Float32Array.from([1, 2, 3]), robotAt(5));
  marks.follow(robotAt(7));
  const placeOf = ({ matrix }) => new Vector3().setFromMatrixPosition(matrix).toArray();
  assert.deepEqual([placeOf(lines), placeOf(points)], [[7, 0, 1], [5, 0, 1]]);
  assert.deepEqual([...points.geometry.attributes.position.array], [1, 2, 3]);
  // A sensor that stands in the world does not follow the robot.
  marks.put([{ ...sensor, section: { ...sensor.section, link: "world" } }]);
  marks.follow(robotAt(7));
  assert.deepEqual(placeOf(marks.object.children[0]), [0, 0, 1]);
  marks.clear();
  assert.equal(marks.object.children.length, 0);
});

test("a section is written as YAML that reads as the same", () => {
  const section = { kind: "camera", link: "no", rpy_rad: null, position_m: [0.1, -0.30000000000000004, 2], noise: { recorded: false } };
  assert.equal(toYaml("head", section), 'sensors:\n  head: {kind: camera, link: "no", position_m: [0.1, -0.3, 2], noise: {recorded: false}}\n');
});

test("messages of cameras are painted as frames of the same encoding", () => {
  const image = (encoding, numbers) => ({ encoding, width: numbers.length, height: 1, data: Buffer.from(numbers.buffer).toString("base64") });
  const greys = (pixels) => [...pixels].filter((_, i) => i % 4 === 0);
  assert.deepEqual(greys(paintImage("depth", image("16UC1", Uint16Array.from([1000, 3000, 0])))), [255, 55, 0]);
  assert.deepEqual(greys(paintImage("depth", image("32FC1", Float32Array.from([1, 3, Infinity])))), [255, 55, 0]);
  assert.deepEqual([...paintImage("color", { ...image("rgb8", Uint8Array.from([7, 8, 9])), width: 1 })], [7, 8, 9, 255]);
});

test("angles of a sensor are those of its rotation, and of the point that it looks at", () => {
  const rpy = [0.3, -0.4, 2.5];
  const turn = new Quaternion().setFromEuler(new Euler(...rpy, "ZYX"));
  rpyOf(turn.toArray()).forEach((angle, i) => near(angle, rpy[i]));
  const point = aimAlong([1, 2, 3], [0, -0.4, 2.5]);
  near(Math.hypot(point[0] - 1, point[1] - 2, point[2] - 3), 1);
  anglesTo([1, 2, 3], point).forEach((angle, i) => near(angle, [0, -0.4, 2.5][i]));
});
