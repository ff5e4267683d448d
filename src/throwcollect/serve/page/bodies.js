/** The ball, and bodies of the scene: boxes, cylinders and spheres that stand in the world. */

import {
  BoxGeometry, CylinderGeometry, Group, Mesh, MeshLambertMaterial, SphereGeometry,
} from "./vendor/three/build/three.module.js";

/**
 * @typedef {object} Body
 * @property {string} name
 * @property {"box" | "cylinder" | "sphere"} shape
 * @property {number[]} size_m edges of the box around it [m], along its own axes
 * @property {number[]} position_m centre [m], frame world
 * @property {number[]} rpy_rad turns about the axes x, y, z of the world, in this order [rad]
 * @property {string} color
 * @property {boolean} moves
 * @property {number[][]} above_m corners of its outline as seen from above [m], frame world
 */

/** Shapes of size 1; cylinders of three.js stand along y, and those of scenes along z. */
const SHAPES = {
  box: new BoxGeometry(),
  cylinder: new CylinderGeometry(0.5, 0.5, 1, 32).rotateX(Math.PI / 2),
  sphere: new SphereGeometry(0.5, 32, 20),
};
/** What is behind the wall of a bin is seen through it. */
const OPACITY = 0.75;
/** The ball is drawn larger than it is, so that it is seen from afar: its diameter [m]. */
const BALL_SIZE_M = 0.08;

/** The bodies around one robot. */
export class Bodies {
  object = new Group();
  /** @type {Map<string, Mesh>} those that move, by name, in the order of their poses in throws */
  #moving = new Map();

  /** @param {Body[]} bodies take the place of those before */
  put(bodies) {
    this.clear();
    for (const { name, shape, size_m, position_m, rpy_rad, color, moves } of bodies) {
      const mesh = new Mesh(SHAPES[shape], new MeshLambertMaterial({ color, transparent: !moves, opacity: moves ? 1 : OPACITY }));
      mesh.name = name;
      mesh.scale.fromArray(name === "ball" ? size_m.map(() => BALL_SIZE_M) : size_m);
      mesh.position.fromArray(position_m);
      mesh.rotation.set(...rpy_rad, "ZYX");
      this.object.add(mesh);
      if (!moves) continue;
      this.#moving.set(name, mesh);
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
    const mesh = this.#moving.get(name);
    if (!mesh) return;
    mesh.visible = true;
    mesh.position.fromArray(pose);
    mesh.quaternion.fromArray(pose, 3);
  }

  clear() {
    for (const mesh of this.object.children) mesh.material.dispose();
    this.object.clear();
    this.#moving.clear();
  }
}
