// Bodies of several shapes, and meshes, on the page. `node --test` runs it; the page's directory is in PAGE.

import assert from "node:assert/strict";
import { test } from "node:test";
import { pathToFileURL } from "node:url";

const load = (name) => import(pathToFileURL(`${process.env.PAGE}/${name}`));
const { Bodies } = await load("bodies.js");
const { BoxGeometry } = await load("vendor/three/build/three.module.js");

const near = (found, wanted) => found.forEach((value, i) => assert.ok(Math.abs(value - wanted[i]) < 1e-6, `${found}`));
const common = { name: "hammer", position_m: [1, 2, 3], rpy_rad: [0, 0, Math.PI / 2], color: "#ff0000", moves: true };
const handle = { ...common, shape: "cylinder", size_m: [0.1, 0.1, 1], within: [[0, 0, 0.5], [0, 0, 0]] };
const head = { ...common, shape: "mesh", size_m: [1, 2, 3], within: [[1, 0, 1], [0, 0, 0]], mesh: "/data/bodies/abc.stl" };

test("all shapes of a body move with it", () => {
  const bodies = new Bodies();
  bodies.put([handle, head]);
  const [one, other] = bodies.object.children;
  near(one.position.toArray(), [1, 2, 3.5]);
  // The body is turned by a quarter about z.
  near(other.position.toArray(), [1, 3, 4]);
  near(other.scale.toArray(), [1, 2, 3]);
  // Half a turn about x.
  bodies.move([[0, 0, 0, 1, 0, 0, 0]]);
  near(one.position.toArray(), [0, 0, -0.5]);
  near(other.position.toArray(), [1, 0, -1]);
});

test("a mesh is drawn once its file is there", async () => {
  const asked = [];
  let loaded = 0;
  Bodies.meshes = { load: async (path) => (asked.push(path), { geometry: new BoxGeometry() }) };
  Bodies.loaded = () => loaded++;
  const bodies = new Bodies();
  bodies.put([head]);
  await new Promise(setImmediate);
  assert.deepEqual([asked, loaded, bodies.object.children[0].geometry.type], [["bodies/abc.stl"], 1, "BoxGeometry"]);
});
