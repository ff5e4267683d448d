/** The three-dimensional view: one tile a simulation, all seen from the same side; or all of them in a room. */

import {
  Color, DirectionalLight, GridHelper, Group, HemisphereLight, Mesh, MeshLambertMaterial, PerspectiveCamera, Scene, SphereGeometry,
  Vector3, WebGLRenderer,
} from "./vendor/three/build/three.module.js";
import { OrbitControls } from "./vendor/three/examples/jsm/controls/OrbitControls.js";
import { Bodies } from "./bodies.js";
import { makeMarker } from "./marker.js";
import { colorOf } from "./outcomes.js";
import { saveFile } from "./saving.js";
import { SensorMarks } from "./sensor_marks.js";
import { posesAt } from "./throws.js";
import { Trails } from "./trails.js";

const TARGET = new Vector3(0.6, 0, 1);
const EYE = new Vector3(3.3, -4, 1.9);
const TURN_RAD = 0.12;
const ZOOM = 1.15;
/** Most robots that are drawn with all triangles; if there are more, all of them are drawn with fewer triangles. */
const MOST_FINE = 1;
/** If pictures take longer than this on average [ms], they are drawn with fewer triangles and points. */
const SLOW_MS = 70;
/** Names of software renderers; browsers with certain settings present some of them as graphics hardware. */
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;
/** A software renderer draws for a third of the time at most, and leaves the processors to the simulations otherwise. */
const SOFTWARE_SHARE = 1 / 3;
/** Time between two pictures that are drawn by software, at least and at most [ms]. */
const SOFTWARE_STEP_MS = [95, 400];
/** Distance between two robots in a room [m]. */
const SPACING_M = 1.5;
/** The object of a throw that another one is compared with. */
const GHOST = new SphereGeometry(0.04, 20, 14);
const GHOST_OPACITY = 0.45;

/** One simulation in the view. */
export class Station {
  group = new Group();
  trails = new Trails();
  bodies = new Bodies();
  sensors = new SensorMarks();
  /** @type {import("./robot.js").Robot | null} */
  robot = null;

  constructor() {
    this.target = makeMarker();
    this.target.visible = false;
    this.group.add(this.trails.object, this.bodies.object, this.sensors.object, this.target);
  }

  /** @param {import("./robot.js").Robot} robot takes the place of the one before, in its posture */
  setRobot(robot) {
    if (this.robot) {
      robot.takeFrom(this.robot);
      this.robot.dispose();
    }
    this.robot = robot;
    this.group.add(robot.object);
  }

  /** @param {number[] | null} place that is aimed at [m], frame world; null if none is */
  setTarget(place) {
    this.target.visible = place !== null;
    if (place) this.target.position.fromArray(place);
  }

  /** @param {import("./throws.js").Throw | null} other throw whose object is drawn transparently; null for none */
  setGhost(other) {
    this.#ghost?.mesh.material.dispose();
    this.#ghost?.mesh.removeFromParent();
    this.#ghost = null;
    if (!other) return;
    const material = new MeshLambertMaterial({ color: colorOf(other.outcome), transparent: true, opacity: GHOST_OPACITY });
    this.#ghost = { other, mesh: new Mesh(GHOST, material) };
    this.group.add(this.#ghost.mesh);
  }

  /** @param {number} time [s] of the replay at which the ghost is drawn */
  moveGhost(time) {
    if (this.#ghost) this.#ghost.mesh.position.fromArray(posesAt(this.#ghost.other, time).at(-1));
  }

  /** @type {{other: import("./throws.js").Throw, mesh: Mesh} | null} */
  #ghost = null;

  dispose() {
    this.setGhost(null);
    this.trails.clear();
    this.bodies.clear();
    this.sensors.clear();
    this.robot?.dispose();
    this.group.removeFromParent();
  }
}

/** Whether pictures are drawn by software, and not by a graphics processor. */
function isDrawnBySoftware() {
  const gl = document.createElement("canvas").getContext("webgl2", { failIfMajorPerformanceCaveat: true });
  if (gl === null) return true;
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  return SOFTWARE.test(gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
}

/** Draws stations into a canvas. */
export class View {
  /** @type {Map<string, Station>} */
  stations = new Map();
  /** @type {string[]} names of the stations that are shown, in order */
  shown = [];
  /** Objects in the frame world, which is moved to the floor of a room while it is shown there. */
  world = new Group();
  /** Objects in the frame of the room, while there is one. */
  room = new Group();
  /** @type {number[] | null} */
  #target = null;
  /** @type {import("./bodies.js").Body[]} */
  #bodies = [];
  #isInRoom = false;
  #scene = new Scene();
  #camera = new PerspectiveCamera(38, 1, 0.05, 60);
  #width = 1;
  #height = 1;
  #columns = 1;
  #rows = 1;
  #changed = true;
  #mean = 0;
  #waited = 0;
  #isBySoftware = isDrawnBySoftware();
  /** Whether robots have fewer triangles, and pictures have one point for each pixel of the page at most. */
  #plain = this.#isBySoftware;
  /** @type {{ended: WebGLSync, beganMs: number} | null} the picture that software draws at the moment */
  #drawn = null;
  #leastMs = 0;

  /**
   * @param {HTMLCanvasElement} canvas
   * @throws {Error} if the browser has no WebGL
   */
  constructor(canvas) {
    this.canvas = canvas;
    // For a software renderer, smooth edges take more time than everything else.
    this.renderer = new WebGLRenderer({ canvas, antialias: !this.#isBySoftware });
    this.#camera.up.set(0, 0, 1);
    this.orbit = new OrbitControls(this.#camera, canvas);
    this.orbit.maxPolarAngle = Math.PI / 2 - 0.02;
    this.orbit.minDistance = 0.6;
    this.orbit.maxDistance = 20;
    this.orbit.addEventListener("change", () => {
      // A user who turns the view wants to see that at once.
      this.#waited = Infinity;
      this.touch();
    });
    this.reset();
    const light = new DirectionalLight("#ffffff", 2);
    light.position.set(3, -2, 5);
    this.world.add(light, light.target);
    this.#scene.add(new HemisphereLight("#ffffff", "#777777", 1.6), this.world, this.room);
    this.#scene.matrixWorldAutoUpdate = false;
    new ResizeObserver(() => this.#resize()).observe(canvas.parentElement);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", () => this.#paint());
    this.#paint();
    this.#resize();
  }

  /** Draw a picture next time, because something has changed. */
  touch() {
    this.#changed = true;
  }

  /** Look from the first point of view again. */
  reset() {
    this.#camera.position.copy(EYE);
    this.orbit.target.copy(TARGET);
    this.orbit.update();
  }

  /**
   * @param {number} right steps to the right
   * @param {number} up steps up
   */
  turn(right, up) {
    this.orbit.rotateLeft(-right * TURN_RAD);
    this.orbit.rotateUp(up * TURN_RAD);
    this.orbit.update();
  }

  /** @param {number} steps nearer */
  zoom(steps) {
    const away = this.#camera.position.clone().sub(this.orbit.target);
    away.setLength(Math.min(Math.max(away.length() * ZOOM ** -steps, this.orbit.minDistance), this.orbit.maxDistance));
    this.#camera.position.copy(this.orbit.target).add(away);
    this.orbit.update();
  }

  /**
   * @param {string[]} names of the simulations to show, in order; a new simulation gets a station
   */
  show(names) {
    this.shown = names;
    for (const name of names) {
      if (this.stations.has(name)) continue;
      const station = new Station();
      station.setTarget(this.#target);
      station.bodies.put(this.#bodies);
      this.stations.set(name, station);
      this.world.add(station.group);
    }
    this.#arrange();
  }

  /** Forget all stations. */
  clear() {
    for (const station of this.stations.values()) station.dispose();
    this.stations.clear();
    this.shown = [];
    this.#bodies = [];
    this.touch();
  }

  /** @param {number[] | null} place that is aimed at [m], frame world; null if none is */
  setTarget(place) {
    this.#target = place;
    for (const station of this.stations.values()) station.setTarget(place);
    this.touch();
  }

  /** @param {import("./bodies.js").Body[]} bodies that stand around each robot, until a throw has others */
  setBodies(bodies) {
    this.#bodies = bodies;
    for (const station of this.stations.values()) station.bodies.put(bodies);
    this.touch();
  }

  /** Prepare to draw into a room. */
  enterRoom() {
    this.#isInRoom = true;
    this.renderer.xr.enabled = true;
    this.renderer.setScissorTest(false);
    this.#paint();
  }

  /**
   * Draw all that is shown, side by side, into a room.
   * @param {PerspectiveCamera} camera for the eyes of the user
   */
  drawRoom(camera) {
    this.#choose();
    for (const [name, { group }] of this.stations) {
      const at = this.shown.indexOf(name);
      group.visible = at >= 0;
      group.position.y = at * SPACING_M;
    }
    this.#scene.updateMatrixWorld();
    this.renderer.render(this.#scene, camera);
  }

  /**
   * @param {Vector3} place in the room [m]; is changed
   * @returns {Vector3} the same in the frame world of the robot that stands nearest
   */
  toWorld(place) {
    this.world.worldToLocal(place);
    place.y -= Math.min(Math.max(Math.round(place.y / SPACING_M), 0), Math.max(this.shown.length - 1, 0)) * SPACING_M;
    return place;
  }

  /** Undo `enterRoom`. */
  leaveRoom() {
    this.#isInRoom = false;
    this.renderer.xr.enabled = false;
    this.room.clear();
    for (const { group } of this.stations.values()) group.position.y = 0;
    this.world.position.set(0, 0, 0);
    this.world.quaternion.identity();
    this.world.visible = true;
    this.#paint();
    this.#resize();
  }

  /**
   * Where a tile is on the stage.
   * @param {string} name
   * @returns {{left: number, top: number, width: number, height: number} | null} in CSS pixels; null if it is not shown
   */
  tileOf(name) {
    const at = this.shown.indexOf(name);
    if (at < 0) return null;
    const [width, height] = [this.#width / this.#columns, this.#height / this.#rows];
    return { left: (at % this.#columns) * width, top: Math.floor(at / this.#columns) * height, width, height };
  }

  /**
   * Where a link is on the stage.
   * @param {string} name of the simulation
   * @param {string} link
   * @returns {{x: number, y: number} | null} in CSS pixels; null if it is not visible
   */
  project(name, link) {
    const tile = this.tileOf(name);
    const place = new Vector3();
    if (!tile || !this.stations.get(name)?.robot?.locate(link, place)) return null;
    place.project(this.#camera);
    if (place.z > 1) return null;
    return { x: tile.left + ((place.x + 1) / 2) * tile.width, y: tile.top + ((1 - place.y) / 2) * tile.height };
  }

  /**
   * @param {number} sinceMs time since the last call of `draw` [ms]
   * @returns {boolean} whether the last picture is finished, and old enough for another one
   */
  isDue(sinceMs) {
    if (this.#drawn !== null) this.#lookAtDrawn();
    return this.#drawn === null && this.#waited + sinceMs >= this.#leastMs;
  }

  /**
   * Draw a picture, if something has changed and the last one is old enough.
   * @param {number} sinceMs time since the last call [ms]
   */
  draw(sinceMs) {
    const isDue = this.isDue(sinceMs);
    this.#waited += sinceMs;
    if (!this.#changed) {
      this.#mean = 0;
      return;
    }
    if (!isDue) return;
    this.#waited = 0;
    this.#changed = false;
    this.#adapt(sinceMs);
    const beganMs = performance.now();
    this.#drawTiles();
    if (this.#isBySoftware) {
      const gl = this.renderer.getContext();
      this.#drawn = { ended: gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0), beganMs };
      gl.flush();
    }
  }

  /**
   * Save what is seen as PNG.
   * @param {string} name of the file
   */
  async savePicture(name) {
    // A browser keeps the pixels of a canvas only until the next picture, so this one is drawn and read at once.
    this.#drawTiles();
    const content = await new Promise((resolve) => this.canvas.toBlob(resolve, "image/png"));
    if (content) saveFile(content, name);
  }

  /** If software has drawn the picture, delay the next one, so that the processors are free in between. */
  #lookAtDrawn() {
    const gl = this.renderer.getContext();
    const { ended, beganMs } = this.#drawn;
    if (!gl.isContextLost() && gl.getSyncParameter(ended, gl.SYNC_STATUS) !== gl.SIGNALED) return;
    gl.deleteSync(ended);
    this.#drawn = null;
    const tookMs = performance.now() - beganMs;
    const [least, most] = SOFTWARE_STEP_MS;
    this.#leastMs = Math.min(Math.max(tookMs / SOFTWARE_SHARE, least), most);
  }

  /** Draw robots with all of their triangles if they are few. */
  #choose() {
    const few = this.shown.length <= MOST_FINE && !this.#plain;
    for (const name of this.shown) this.stations.get(name).robot?.setCoarse(!few);
  }

  #drawTiles() {
    this.#choose();
    this.#scene.updateMatrixWorld();
    this.renderer.setScissorTest(true);
    for (const station of this.stations.values()) station.group.visible = false;
    for (const name of this.shown.length ? this.shown : [""]) this.#drawTile(name);
  }

  #drawTile(name) {
    const station = this.stations.get(name);
    const { left, top, width, height } = this.tileOf(name) ?? { left: 0, top: 0, width: this.#width, height: this.#height };
    const bottom = this.#height - top - height;
    this.renderer.setViewport(left, bottom, width, height);
    this.renderer.setScissor(left, bottom, width, height);
    if (station) station.group.visible = true;
    this.renderer.render(this.#scene, this.#camera);
    if (station) station.group.visible = false;
  }

  /** Draw fewer triangles and points if pictures take long. */
  #adapt(sinceMs) {
    this.#mean = this.#mean === 0 ? Math.min(sinceMs, SLOW_MS) : 0.9 * this.#mean + 0.1 * Math.min(sinceMs, 1000);
    if (this.#mean > SLOW_MS && !this.#plain) {
      this.#plain = true;
      this.#resize();
    }
  }

  #resize() {
    const box = this.canvas.parentElement;
    this.#width = Math.max(1, box.clientWidth);
    this.#height = Math.max(1, box.clientHeight);
    // In a room, the device determines the size; `leaveRoom` calls this again.
    if (this.#isInRoom) return;
    this.renderer.setPixelRatio(this.#plain ? 1 : Math.min(devicePixelRatio, 2));
    this.renderer.setSize(this.#width, this.#height, false);
    this.#arrange();
  }

  /** Choose the number of columns whose tiles are nearest to squares. */
  #arrange() {
    const count = Math.max(1, this.shown.length);
    let best = Infinity;
    for (let columns = 1; columns <= count; columns++) {
      const rows = Math.ceil(count / columns);
      const shape = Math.abs(Math.log(this.#width / columns / (this.#height / rows))) + 0.4 * (columns * rows - count);
      if (shape < best) [best, this.#columns, this.#rows] = [shape, columns, rows];
    }
    this.#camera.aspect = this.#width / this.#columns / (this.#height / this.#rows);
    // If a tile is higher than wide, the angle of view grows, so that it shows as much from left to right.
    this.#camera.fov = this.#camera.aspect >= 1 ? 38 : Math.min(75, 38 / this.#camera.aspect);
    this.#camera.updateProjectionMatrix();
    this.touch();
  }

  #paint() {
    const style = getComputedStyle(document.documentElement);
    this.#scene.background = this.#isInRoom ? null : new Color(style.getPropertyValue("--sky").trim());
    this.#grid?.removeFromParent();
    const line = style.getPropertyValue("--grid").trim();
    this.#grid = new GridHelper(16, 32, line, line);
    this.#grid.rotation.x = Math.PI / 2;
    // A room has a floor of its own.
    if (!this.#isInRoom) this.world.add(this.#grid);
    this.touch();
  }

  #grid = null;
}
