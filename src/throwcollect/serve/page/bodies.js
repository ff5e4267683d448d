/** The ball, and bodies of the scene: boxes, cylinders, spheres and meshes that stand in the world. */

import {
  BoxGeometry, BufferGeometry, CylinderGeometry, Euler, Group, Mesh, MeshLambertMaterial, Quaternion, SphereGeometry, Vector3,
} from "./vendor/three/build/three.module.js";

/**
 * @typedef {object} Body a shape of a body
 * @property {string} name of the body
 * @property {"box" | "cylinder" | "sphere" | "mesh"} shape
 * @property {number[]} size_m edges of the box around it [m], along its own axes; of a mesh, factors on its coordinates
 * @property {number[]} position_m origin of the body [m], frame world
 * @property {number[]} rpy_rad turns about the axes x, y, z of the world, in this order [rad]
 * @property {string} color
 * @property {boolean} moves
 * @property {number[][]} above_m corners of its outline as seen from above [m], frame world
 * @property {number[][]} [within] position [m] and turns of the shape in the body; none if it is in the middle
 * @property {string} [mesh] file of a mesh
 */

/** Shapes of size 1; cylinders of three.js stand along y, and those of scenes along z. */
const SHAPES = {
  box: new BoxGeometry(),
  cylinder: new CylinderGeometry(0.5, 0.5, 1, 32).rotateX(Math.PI / 2),
  sphere: new SphereGeometry(0.5, 32, 20),
};
/** What is behind the wall of a bin is seen through it. */
const OPACITY = 0.75;
const HERE = [[0, 0, 0], [0, 0, 0]];
/** The ball is drawn larger than it is, so that it is seen from afar: its diameter [m]. */
const BALL_SIZE_M = 0.08;

/** @param {number[]} rpy turns about fixed axes x, y, z, in this order [rad] */
function turnOf(rpy) {
  return new Quaternion().setFromEuler(new Euler(...rpy, "ZYX"));
}

/** Put a shape where it is in a body with this pose. */
function put(mesh, position, turn) {
  const [offset, own] = mesh.userData.within;
  mesh.position.copy(offset).applyQuaternion(turn).add(position);
  mesh.quaternion.copy(turn).multiply(own);
}

/** Give a shape the triangles of a file; without them, the body is not drawn. */
function load(file, mesh) {
  const path = `bodies/${file.split("/").pop()}`;
  Bodies.meshes?.load(path).then(({ geometry }) => {
    mesh.geometry = geometry;
    Bodies.loaded();
  }, () => {});
}

/** The bodies around one robot. */
export class Bodies {
  /** @type {import("./robot.js").Meshes | null} loads the files of meshes */
  static meshes = null;
  /** Is called when a mesh has been loaded. */
  static loaded = () => {};

  object = new Group();
  /** @type {Map<string, Mesh[]>} shapes of those that move, by name, in the order of their poses in throws */
  #moving = new Map();

  /** @param {Body[]} bodies take the place of those before */
  put(bodies) {
    this.clear();
    for (const { name, shape, size_m, position_m, rpy_rad, color, moves, within = HERE, mesh: file } of bodies) {
      const mesh = new Mesh(SHAPES[shape] ?? new BufferGeometry(), new MeshLambertMaterial({ color, transparent: !moves, opacity: moves ? 1 : OPACITY }));
      mesh.name = name;
      mesh.scale.fromArray(name === "ball" ? size_m.map(() => BALL_SIZE_M) : size_m);
      mesh.userData.within = [new Vector3(...within[0]), turnOf(within[1])];
      put(mesh, new Vector3(...position_m), turnOf(rpy_rad));
      this.object.add(mesh);
      if (file) load(file, mesh);
      if (!moves) continue;
      this.#moving.set(name, [...(this.#moving.get(name) ?? []), mesh]);
      // Where a ball in the tool is shows only when it has moved.
      mesh.visible = name !== "ball";
    }
  }

  /** @param {number[][]} poses centre [m] and quaternion of each body that moves, frame world */
  move(poses) {
    [...this.#moving.keys()].forEach((name, i) => poses[i] && this.place(name, poses[i]));
  }

  /**
   * @param {string} name of a body that moves
   * @param {number[]} pose centre [m] and quaternion, frame world
   */
  place(name, pose) {
    for (const mesh of this.#moving.get(name) ?? []) {
      mesh.visible = true;
      put(mesh, new Vector3().fromArray(pose), new Quaternion().fromArray(pose, 3));
    }
  }

  clear() {
    for (const mesh of this.object.children) mesh.material.dispose();
    this.object.clear();
    this.#moving.clear();
  }
}
