/** Robots from their descriptions; each mesh is fetched once for all robots. */

import { CylinderGeometry, Group, Mesh, MeshLambertMaterial, Vector3 } from "./vendor/three/build/three.module.js";
import { ColladaLoader } from "./vendor/three/examples/jsm/loaders/ColladaLoader.js";
import { OBJLoader } from "./vendor/three/examples/jsm/loaders/OBJLoader.js";
import { STLLoader } from "./vendor/three/examples/jsm/loaders/STLLoader.js";
import URDFLoader from "./vendor/urdf-loader/src/URDFLoader.js";
import { coarsen } from "./coarse.js";

const PACKAGE = "package://";
const MOUNT_RADIUS_M = 0.08;
const MOUNT_COLOR = "#8c9096";
/** Edges of the cubes that merge vertices, as shares of a mesh's size; the first edge that gives few triangles is used. */
const SHARES = [1 / 32, 1 / 24, 1 / 16, 1 / 12];
const FEW_TRIANGLES = 1200;

/** From full geometries to those with fewer triangles, and back. Clones of meshes share their geometries. */
const COARSE = new WeakMap();
const FINE = new WeakMap();

/** Make geometries with fewer triangles for all parts of a mesh's file. */
function coarsenAll(whole) {
  whole.traverse((part) => {
    if (!part.isMesh) return;
    part.geometry.computeBoundingBox();
    const size = part.geometry.boundingBox.getSize(new Vector3());
    let coarse = part.geometry;
    for (const share of SHARES) {
      const edge = Math.max(size.x, size.y, size.z) * share;
      if (edge > 0 && (coarse.index ?? coarse.getAttribute("position")).count > 3 * FEW_TRIANGLES) coarse = coarsen(coarse, edge);
    }
    if (coarse === part.geometry) return;
    COARSE.set(part.geometry, coarse);
    FINE.set(coarse, part.geometry);
  });
  return whole;
}

/** Files of meshes, fetched when a description first names them. */
export class Meshes {
  /** @type {Map<string, Promise<import("./vendor/three/build/three.module.js").Object3D>>} */
  #files = new Map();

  /** @param {(path: string) => Promise<ArrayBuffer>} fetchMesh fetches PACKAGE/PATH */
  constructor(fetchMesh) {
    this.fetchMesh = fetchMesh;
  }

  /** @returns {number} files that have been fetched */
  get count() {
    return this.#files.size;
  }

  /**
   * @param {string} path PACKAGE/PATH
   * @returns {Promise<import("./vendor/three/build/three.module.js").Object3D>} a copy that shares its geometries
   */
  async load(path) {
    if (!this.#files.has(path)) {
      const file = this.fetchMesh(path).then((bytes) => coarsenAll(parse(path, bytes)));
      this.#files.set(path, file);
      // The next robot tries again.
      file.catch(() => this.#files.delete(path));
    }
    return (await this.#files.get(path)).clone();
  }
}

/**
 * @param {string} path
 * @param {ArrayBuffer} bytes
 * @returns {import("./vendor/three/build/three.module.js").Object3D}
 * @throws {Error} if its format is not known
 */
function parse(path, bytes) {
  const kind = path.slice(path.lastIndexOf(".") + 1).toLowerCase();
  if (kind === "stl") {
    const mesh = new Mesh(new STLLoader().parse(bytes));
    // STL has no colour; the description has one.
    mesh.userData.bare = true;
    return mesh;
  }
  if (kind === "dae") return new ColladaLoader().parse(new TextDecoder().decode(bytes), "").scene;
  if (kind === "obj") return new OBJLoader().parse(new TextDecoder().decode(bytes));
  throw new Error(`${path}: neither STL nor Collada nor OBJ`);
}

/** A column from the ground to the base. */
function makeMount(height) {
  const shape = new CylinderGeometry(MOUNT_RADIUS_M, MOUNT_RADIUS_M, height).rotateX(Math.PI / 2);
  const mount = new Mesh(shape, new MeshLambertMaterial({ color: MOUNT_COLOR }));
  mount.position.z = -height / 2;
  return mount;
}

/** A robot whose base is fixed above the origin. */
export class Robot {
  object = new Group();
  /** Whether all meshes have been fetched. */
  isWhole = false;
  #robot;
  #positions = new Map();
  #coarse = false;

  /**
   * @param {string} urdf description
   * @param {{base_height_m: number, mount_height_m: number}} scene heights of the base above the ground, and of the mount below it
   * @param {Meshes} meshes
   * @param {() => void} changed called when there is something new to draw
   * @param {(error: Error) => void} failed called for each mesh that cannot be fetched
   * @throws {Error} if the description cannot be read
   */
  constructor(urdf, scene, meshes, changed, failed) {
    this.urdf = urdf;
    this.object.position.z = scene.base_height_m;
    if (scene.mount_height_m > 0) this.object.add(makeMount(scene.mount_height_m));
    const loader = new URDFLoader();
    loader.packages = (name) => PACKAGE + name;
    loader.parseCollision = false;
    const loading = [];
    loader.loadMeshCb = (url, _manager, material, done) => {
      const load = meshes.load(url.replace(PACKAGE, "").replace(/^\/+/, "")).then(
        (mesh) => {
          done(mesh);
          mesh.traverse((part) => {
            if (part.isMesh && part.userData.bare) part.material = material;
            this.#choose(part);
          });
          changed();
        },
        (error) => {
          done(null);
          failed(error);
        },
      );
      loading.push(load);
    };
    this.#robot = loader.parse(urdf);
    this.object.add(this.#robot);
    /** Resolves when each mesh has been fetched, or its request has failed. */
    this.whole = Promise.all(loading).then(() => {
      this.isWhole = true;
      changed();
    });
  }

  /** @returns {string[]} names of its links */
  get links() {
    return Object.keys(this.#robot.links);
  }

  /** @returns {string[]} names of its joints that move */
  get joints() {
    return Object.values(this.#robot.joints).filter((joint) => joint.jointType !== "fixed").map((joint) => joint.urdfName);
  }

  /**
   * @param {string} joint
   * @returns {string | undefined} name of the link that it moves
   */
  linkMovedBy(joint) {
    return this.#robot.joints[joint]?.children.find((child) => child.isURDFLink)?.urdfName;
  }

  /**
   * @param {string} joint
   * @returns {boolean} whether its positions are in m
   */
  slides(joint) {
    return this.#robot.joints[joint]?.jointType === "prismatic";
  }

  /** @param {Iterable<[string, number]>} positions of joints [rad or m]; others stay where they are */
  move(positions) {
    for (const [joint, position] of positions) {
      this.#positions.set(joint, position);
      this.#robot.joints[joint]?.setJointValue(position);
    }
  }

  /** @param {Robot} other takes its place, and its posture */
  takeFrom(other) {
    if (other.#positions.size) this.move(other.#positions);
    this.setCoarse(other.#coarse);
  }

  /**
   * @param {string} link
   * @param {Vector3} place is set to its origin [m], frame world
   * @returns {boolean} whether there is such a link
   */
  locate(link, place) {
    const found = this.#robot.links[link];
    if (found) found.getWorldPosition(place);
    return Boolean(found);
  }

  /**
   * @param {string} link
   * @returns {import("./vendor/three/build/three.module.js").Matrix4 | null} its pose, frame world; null if there is no such link
   */
  poseOf(link) {
    const found = this.#robot.links[link];
    if (!found) return null;
    found.updateWorldMatrix(true, false);
    return this.object.parent.matrixWorld.clone().invert().multiply(found.matrixWorld);
  }

  /** @param {boolean} coarse whether to draw meshes with fewer triangles */
  setCoarse(coarse) {
    if (coarse === this.#coarse) return;
    this.#coarse = coarse;
    this.#robot.traverse((part) => this.#choose(part));
  }

  /** Free the geometries that no other robot shares. */
  dispose() {
    this.object.removeFromParent();
    this.object.traverse((part) => {
      if (part.isMesh && !COARSE.has(part.geometry) && !FINE.has(part.geometry)) part.geometry.dispose();
    });
  }

  #choose(part) {
    if (part.isMesh) part.geometry = (this.#coarse ? COARSE : FINE).get(part.geometry) ?? part.geometry;
  }
}
