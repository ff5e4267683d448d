/** Paths of the object in the throw that is replayed and, fainter, in earlier throws, coloured by outcome. */

import {
  CatmullRomCurve3, CircleGeometry, Group, Mesh, MeshBasicMaterial, TubeGeometry, Vector3,
} from "./vendor/three/build/three.module.js";
import { colorOf } from "./outcomes.js";

const KEPT = 12;
const SEGMENTS = 48;
const SIDES = 5;
const RADIUS_M = 0.008;
const MARK_RADIUS_M = 0.035;

/** @typedef {import("./throws.js").Throw} Throw */

/** Trails of one simulation. */
export class Trails {
  object = new Group();
  /** @type {{shown: Throw, tube: Mesh, mark: Mesh | null}[]} the newest last */
  #trails = [];

  /** @returns {number} trails that are drawn */
  get count() {
    return this.#trails.length;
  }

  /** @param {Throw} shown becomes the newest */
  add(shown) {
    const points = [];
    const last = shown.samples - 1;
    const segments = Math.min(SEGMENTS, last);
    for (let i = 0; i <= segments; i++) points.push(new Vector3().fromArray(shown.path, 3 * Math.round((i * last) / segments)));
    if (points.length < 2) return;
    const material = new MeshBasicMaterial({ color: colorOf(shown.outcome), transparent: true });
    // The curve is sampled by time: with arc lengths, a share of the tube would not be the same share of the time.
    const curve = new CatmullRomCurve3(points, false, "catmullrom", 0);
    curve.getPointAt = curve.getPoint;
    curve.getTangentAt = curve.getTangent;
    const tube = new Mesh(new TubeGeometry(curve, points.length - 1, RADIUS_M, SIDES), material);
    let mark = null;
    if (shown.landing) {
      mark = new Mesh(new CircleGeometry(MARK_RADIUS_M, 20), material);
      mark.position.fromArray(shown.landing);
      mark.position.z += 0.004;
      this.object.add(mark);
    }
    this.object.add(tube);
    this.#trails.push({ shown, tube, mark });
    while (this.#trails.length > KEPT) this.#drop(this.#trails.shift());
    this.#trails.forEach((trail, i) => {
      trail.tube.material.opacity = i === this.#trails.length - 1 ? 1 : 0.3 + (0.4 * i) / KEPT;
      trail.tube.geometry.setDrawRange(0, Infinity);
      if (trail.mark) trail.mark.visible = true;
    });
  }

  /**
   * Draw the newest trail as far as the object has come.
   * @param {number} share of the throw's time
   */
  reveal(share) {
    const newest = this.#trails.at(-1);
    if (!newest) return;
    const segments = Math.ceil(newest.tube.geometry.parameters.tubularSegments * share);
    newest.tube.geometry.setDrawRange(0, segments * SIDES * 6);
    if (newest.mark) newest.mark.visible = share >= 1;
  }

  clear() {
    for (const trail of this.#trails.splice(0)) this.#drop(trail);
  }

  #drop({ tube, mark }) {
    for (const part of [tube, mark]) {
      if (!part) continue;
      part.removeFromParent();
      part.geometry.dispose();
    }
    tube.material.dispose();
  }
}
