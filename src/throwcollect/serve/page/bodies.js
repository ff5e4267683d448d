/** Bodies of the scene: boxes, cylinders and spheres that stand in the world. */

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
/** Balls behind the wall of a bin are seen through it. */
const OPACITY = 0.75;

/** The bodies around one robot. */
export class Bodies {
  object = new Group();
  /** @type {Mesh[]} */
  #moving = [];

  /** @param {Body[]} bodies take the place of those before */
  put(bodies) {
    this.clear();
    for (const { name, shape, size_m, position_m, rpy_rad, color, moves } of bodies) {
      const mesh = new Mesh(SHAPES[shape], new MeshLambertMaterial({ color, transparent: true, opacity: OPACITY }));
      mesh.name = name;
      mesh.scale.fromArray(size_m);
      mesh.position.fromArray(position_m);
      mesh.rotation.set(...rpy_rad, "ZYX");
      this.object.add(mesh);
      if (moves) this.#moving.push(mesh);
    }
  }

  /** @param {number[][]} poses centre [m] and quaternion of each body that moves, frame world */
  move(poses) {
    this.#moving.forEach((mesh, i) => {
      if (!poses[i]) return;
      mesh.position.fromArray(poses[i]);
      mesh.quaternion.fromArray(poses[i], 3);
    });
  }

  clear() {
    for (const mesh of this.object.children) mesh.material.dispose();
    this.object.clear();
    this.#moving = [];
  }
}
