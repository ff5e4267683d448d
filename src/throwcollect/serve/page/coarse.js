/** Meshes with fewer triangles, for robots that are small on the screen or many. */

import { BufferAttribute, BufferGeometry } from "./vendor/three/build/three.module.js";

/** Cubes along each axis of the lattice, at most. */
const LATTICE = 2 ** 15;

/** Numbers of values: each new value gets the next number. */
class Numbering {
  #numbers = new Map();

  of(value) {
    let number = this.#numbers.get(value);
    if (number === undefined) {
      number = this.#numbers.size;
      this.#numbers.set(value, number);
    }
    return number;
  }
}

/**
 * Merge the vertices of each small cube into one, and drop triangles that have no area left.
 *
 * Vertices are merged only if their normals point to the same octant, so that edges stay sharp, and a thin wall keeps
 * both of its sides.
 * @param {BufferGeometry} geometry with normals
 * @param {number} edge length of the cubes' edges, in units of the mesh
 * @returns {BufferGeometry} with an index
 */
export function coarsen(geometry, edge) {
  const [position, normal] = [geometry.getAttribute("position"), geometry.getAttribute("normal")];
  const [cubes, corners] = [new Numbering(), new Numbering()];
  const cubeOf = [];
  const cornerOf = [];
  const sums = [];
  const normals = [];
  const cubeOfCorner = [];
  const along = (value) => Math.floor(value / edge) + LATTICE / 2;
  for (let i = 0; i < position.count; i++) {
    const place = [position.getX(i), position.getY(i), position.getZ(i)];
    const side = [normal.getX(i), normal.getY(i), normal.getZ(i)];
    const cube = cubes.of((along(place[0]) * LATTICE + along(place[1])) * LATTICE + along(place[2]));
    const corner = corners.of(cube * 8 + (side[0] > 0 ? 4 : 0) + (side[1] > 0 ? 2 : 0) + (side[2] > 0 ? 1 : 0));
    [cubeOf[i], cornerOf[i], cubeOfCorner[corner]] = [cube, corner, cube];
    const sum = (sums[cube] ??= [0, 0, 0, 0]);
    const direction = (normals[corner] ??= [0, 0, 0]);
    for (let axis = 0; axis < 3; axis++) {
      sum[axis] += place[axis];
      direction[axis] += side[axis];
    }
    sum[3] += 1;
  }
  const index = geometry.getIndex();
  const count = index ? index.count : position.count;
  const triangles = [];
  const coarse = new BufferGeometry();
  // A mesh with several materials draws its groups of triangles alone.
  for (const group of geometry.groups.length ? geometry.groups : [{ start: 0, count }]) {
    const start = triangles.length;
    for (let i = group.start; i < group.start + group.count; i += 3) {
      const [a, b, c] = [i, i + 1, i + 2].map((at) => (index ? index.getX(at) : at));
      if (cubeOf[a] !== cubeOf[b] && cubeOf[b] !== cubeOf[c] && cubeOf[c] !== cubeOf[a]) {
        triangles.push(cornerOf[a], cornerOf[b], cornerOf[c]);
      }
    }
    coarse.addGroup(start, triangles.length - start, group.materialIndex);
  }
  const places = cubeOfCorner.flatMap((cube) => sums[cube].slice(0, 3).map((sum) => sum / sums[cube][3]));
  coarse.setAttribute("position", new BufferAttribute(Float32Array.from(places), 3));
  coarse.setAttribute("normal", new BufferAttribute(Float32Array.from(normals.flat()), 3));
  coarse.normalizeNormals();
  coarse.setIndex(triangles);
  return coarse;
}
