/** The marker of a target: a ball with a ring around it. */

import { Group, Mesh, MeshBasicMaterial, SphereGeometry, TorusGeometry } from "./vendor/three/build/three.module.js";
import { TARGET_COLOR } from "./outcomes.js";

const BALL = new SphereGeometry(0.025, 16, 12);
const RING = new TorusGeometry(0.08, 0.007, 8, 36);
const MATERIAL = new MeshBasicMaterial({ color: TARGET_COLOR });

/** @returns {Group} a marker around its origin; all markers share their geometries */
export function makeMarker() {
  const marker = new Group();
  marker.add(new Mesh(BALL, MATERIAL), new Mesh(RING, MATERIAL));
  return marker;
}
