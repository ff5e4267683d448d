/** The view in the room of a user with a headset (WebXR, immersive-ar): placed on the floor, with a target in the hand. */

import {
  BufferGeometry, Line, LineBasicMaterial, Matrix4, Mesh, MeshBasicMaterial, PerspectiveCamera, Quaternion, Raycaster, RingGeometry, Vector3,
} from "./vendor/three/build/three.module.js";
import { InfoBoard, MapBoard, PlotBoard } from "./boards.js";
import { get, setText } from "./dom.js";
import { makeMarker } from "./marker.js";
import { TARGET_COLOR } from "./outcomes.js";
import { RoomSensors } from "./room_sensors.js";

const FEATURES = { requiredFeatures: ["local-floor"], optionalFeatures: ["hit-test", "hand-tracking"] };
const UP = new Vector3(0, 1, 0);
/** Turns the frame world, whose z points up, into that of a room, whose y points up. */
const UPRIGHT = new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), -Math.PI / 2);
/** Distance of robots in front of the user if the device knows no floor [m]. */
const AHEAD_M = 2;
const RAY_M = 1.5;
/** Size of the target in a hand, relative to one that was set. */
const HELD = 0.6;
/** Place of the info board, and the distance below it of plots that follow no link [m], frame world. */
const BOARD = new Vector3(-1.1, 0, 1.45);
const BELOW_M = 0.5;
const PLOT_HEIGHT_M = 0.33;
/** Distance of a plot in front of the link that it follows, so that no robot hides it [m]. */
const BEFORE_M = 0.4;
/** Distance of a new camera in front of the user [m]. */
const WITHIN_REACH_M = 0.6;

/** Enters and leaves a room. */
export class Room {
  isEntered = false;
  #session = null;
  #camera = new PerspectiveCamera(50, 1, 0.05, 60);
  #eye = new Vector3();
  #ahead = new Vector3(0, 0, -1);
  #before = 0;
  /** Hit test that finds the floor; undefined until the device has answered, null if it has none. */
  #finder;
  #isPlaced = false;
  /** @type {Map<XRInputSource, {marker: import("./marker.js").Group, ray: Line}>} */
  #hands = new Map();
  /** @type {Map<import("./plot_panel.js").PlotPanel, PlotBoard>} */
  #plotBoards = new Map();

  /**
   * @param {object} parts
   * @param {import("./scene.js").View} parts.view
   * @param {import("./landing_map.js").LandingMap} parts.map
   * @param {import("./target.js").Target} parts.target
   * @param {import("./plots.js").Plots} parts.plots
   * @param {import("./sensor_strip.js").SensorStrip} parts.strip
   * @param {(text: string) => void} parts.tell shows what is wrong
   * @param {(seconds: number) => void} parts.advance moves replays and live simulations on
   * @param {() => import("./boards.js").Facts} parts.facts returns what the info board shows
   */
  constructor({ view, map, target, plots, strip, tell, advance, facts }) {
    Object.assign(this, { view, map, target, plots, strip, tell, advance, facts });
    this.sensors = new RoomSensors(view, strip);
    this.button = get("enter-room");
    this.button.addEventListener("click", () => this.#toggle());
    navigator.xr?.addEventListener("devicechange", () => this.#offer());
    this.#offer();
  }

  /** Show the button if there is a device, or if there might be one at an address with HTTPS. */
  async #offer() {
    const { xr } = navigator;
    const isThere = Boolean(xr) && (await xr.isSessionSupported("immersive-ar").catch(() => false));
    this.button.hidden = !isThere && isSecureContext;
    this.button.setAttribute("aria-disabled", String(!isThere));
  }

  async #toggle() {
    if (this.#session) {
      this.#session.end();
      return;
    }
    if (!isSecureContext) {
      this.tell("augmented reality needs HTTPS, or an address on localhost");
      return;
    }
    try {
      this.#session = await navigator.xr.requestSession("immersive-ar", FEATURES);
      await this.#enter(this.#session);
    } catch (error) {
      this.tell(`the room cannot be entered: ${error.message}`);
      this.#session?.end();
      this.#session = null;
    }
  }

  async #enter(session) {
    const { view } = this;
    session.addEventListener("end", () => this.#leave());
    session.addEventListener("selectstart", ({ frame, inputSource }) => this.#take(frame, inputSource));
    session.addEventListener("select", ({ frame, inputSource }) => this.#select(frame, inputSource));
    session.addEventListener("selectend", ({ frame, inputSource }) => this.#moveSensor(frame, inputSource, true));
    this.isEntered = true;
    this.#isPlaced = false;
    this.#finder = undefined;
    view.enterRoom();
    this.strip.enter(true);
    view.world.visible = false;
    this.info = new InfoBoard([
      { text: "Place again", isOffered: () => true, act: () => this.#placeAgain() },
      { text: "Add a camera", isOffered: () => this.strip.source !== null, act: () => this.#addCamera() },
      { text: "Leave", isOffered: () => true, act: () => session.end() },
    ]);
    this.mapBoard = new MapBoard(this.map);
    this.reticle = new Mesh(new RingGeometry(0.09, 0.12, 36).rotateX(-Math.PI / 2), new MeshBasicMaterial({ color: TARGET_COLOR }));
    this.reticle.visible = false;
    view.world.add(this.mapBoard.mesh);
    view.room.add(this.info.mesh, this.reticle);
    await view.renderer.xr.setSession(session);
    // The user may have left before the device was ready.
    if (this.#session !== session) return;
    view.renderer.setAnimationLoop((now, frame) => this.#draw(now, frame));
    this.#label("Leave AR");
    const finder = await findFloor(session);
    if (this.#session === session) this.#finder = finder;
  }

  #leave() {
    const { view } = this;
    view.renderer.setAnimationLoop(null);
    for (const board of [this.info, this.mapBoard, ...this.#plotBoards.values()]) board.dispose();
    this.sensors.dispose();
    this.strip.enter(false);
    for (const source of [...this.#hands.keys()]) this.#drop(source);
    this.reticle.geometry.dispose();
    this.reticle.material.dispose();
    this.#plotBoards.clear();
    this.#session = null;
    this.isEntered = false;
    view.leaveRoom();
    this.#label("Enter AR");
  }

  #label(text) {
    setText(this.button, text);
    this.button.setAttribute("aria-pressed", String(this.isEntered));
  }

  #draw(now, frame) {
    if (!frame) return;
    this.advance(this.#before ? (now - this.#before) / 1000 : 0);
    this.#before = now;
    const space = this.view.renderer.xr.getReferenceSpace();
    const pose = frame.getViewerPose(space);
    if (pose) {
      const { position, orientation } = pose.transform;
      this.#eye.copy(position);
      const ahead = new Vector3(0, 0, -1).applyQuaternion(orientation).setY(0);
      if (ahead.lengthSq() > 1e-3) this.#ahead = ahead.normalize();
      if (!this.#isPlaced) this.#find(frame, space);
    }
    for (const source of frame.session.inputSources) if (this.sensors.holds(source)) this.#moveSensor(frame, source);
    const rays = this.#showHands(frame, space);
    this.#showBoards(rays);
    this.view.drawRoom(this.#camera);
  }

  /** Show where on the floor the trigger would place everything; place it at once if the device knows no floor. */
  #find(frame, space) {
    const hit = this.#finder && frame.getHitTestResults(this.#finder)[0]?.getPose(space);
    this.reticle.visible = Boolean(hit);
    if (hit) this.reticle.position.copy(hit.transform.position);
    if (this.#finder === null) this.#placeAhead();
  }

  #placeAhead() {
    this.#place(new Vector3(this.#eye.x, 0, this.#eye.z).addScaledVector(this.#ahead, AHEAD_M));
  }

  #placeAgain() {
    if (!this.#finder) {
      this.#placeAhead();
      return;
    }
    this.#isPlaced = false;
    this.view.world.visible = false;
  }

  /** Place the first robot on the floor so that it throws to the right of the user. */
  #place(floor) {
    const { world } = this.view;
    world.position.copy(floor);
    world.quaternion.setFromAxisAngle(UP, Math.atan2(-this.#ahead.x, -this.#ahead.z)).multiply(UPRIGHT);
    world.visible = true;
    this.#isPlaced = true;
    this.reticle.visible = false;
  }

  /** Take the sensor that a hand points at, unless a board is in between. */
  #take(frame, source) {
    const space = this.view.renderer.xr.getReferenceSpace();
    const [ray, hand] = [rayOf(frame, source, space), poseOf(frame, source, space)];
    if (!ray || !this.#isPlaced || ray.intersectObjects(this.#boards.map(({ mesh }) => mesh)).length) return;
    this.sensors.take(source, ray.ray, hand);
  }

  /** Add a camera before the user, where a hand reaches it. */
  #addCamera() {
    const place = this.#eye.clone().addScaledVector(this.#ahead, WITHIN_REACH_M).addScaledVector(UP, -WITHIN_REACH_M / 2);
    this.strip.add(this.view.toWorld(place).toArray());
  }

  #moveSensor(frame, source, isLast = false) {
    const hand = poseOf(frame, source, this.view.renderer.xr.getReferenceSpace());
    if (hand) this.sensors.move(source, hand, isLast);
  }

  #select(frame, source) {
    const space = this.view.renderer.xr.getReferenceSpace();
    if (!this.#isPlaced) {
      if (this.reticle.visible) this.#place(this.reticle.position);
      return;
    }
    const ray = rayOf(frame, source, space);
    const [hit] = ray?.intersectObjects(this.#boards.map(({ mesh }) => mesh)) ?? [];
    if (hit) {
      hit.object.userData.board.press(hit.uv);
      return;
    }
    // A hand that lets a sensor go sets no target. Some devices select before they say that a selection begins.
    if (this.sensors.holds(source) || (ray && this.sensors.find(ray.ray))) return;
    const place = placeOf(frame, source, space) ?? meetFloor(ray, this.view.world.position.y);
    if (place) this.target.set(this.view.toWorld(place).toArray());
  }

  /** Put the target into each hand, and a ray before it; returns the rays. */
  #showHands(frame, space) {
    const sources = [...frame.session.inputSources];
    for (const source of this.#hands.keys()) if (!sources.includes(source)) this.#drop(source);
    const rays = [];
    for (const source of sources) {
      const place = placeOf(frame, source, space);
      const found = rayOf(frame, source, space);
      if (found) rays.push(found.ray);
      if (source.targetRayMode !== "tracked-pointer") continue;
      const { marker, ray } = this.#handOf(source);
      marker.visible = place !== null && this.#isPlaced;
      if (place) marker.position.copy(place);
      ray.visible = found !== null;
      if (found) ray.geometry.setFromPoints([found.ray.origin, found.ray.at(RAY_M, new Vector3())]);
    }
    return rays;
  }

  #handOf(source) {
    if (!this.#hands.has(source)) {
      const ray = new Line(new BufferGeometry(), new LineBasicMaterial({ color: "#9aa7b5" }));
      ray.frustumCulled = false;
      const hand = { marker: makeMarker(), ray };
      hand.marker.scale.setScalar(HELD);
      this.view.room.add(hand.marker, ray);
      this.#hands.set(source, hand);
    }
    return this.#hands.get(source);
  }

  #drop(source) {
    const { marker, ray } = this.#hands.get(source);
    marker.removeFromParent();
    ray.removeFromParent();
    ray.geometry.dispose();
    ray.material.dispose();
    this.#hands.delete(source);
  }

  get #boards() {
    return [this.info, ...this.#plotBoards.values(), ...this.sensors.boards].filter(({ mesh }) => mesh.visible);
  }

  #showBoards(rays) {
    const { world } = this.view;
    this.info.mesh.visible = this.#isPlaced;
    this.info.stand(world.localToWorld(BOARD.clone()), this.#eye);
    const caster = new Raycaster();
    const pointed = rays.map((ray) => {
      caster.ray = ray;
      const [hit] = caster.intersectObject(this.info.mesh);
      return hit ? this.info.buttonAt(hit.uv) : null;
    });
    this.info.show(this.facts(), pointed.find((each) => each !== null) ?? null);
    this.mapBoard.show();
    this.#showPlots();
    this.sensors.show(this.#eye, this.#isPlaced);
  }

  #showPlots() {
    for (const [panel, board] of this.#plotBoards) {
      if (this.plots.panels.includes(panel)) continue;
      board.dispose();
      this.#plotBoards.delete(panel);
    }
    let docked = 0;
    let following = 0;
    for (const panel of this.plots.panels) {
      const board = this.#boardOf(panel);
      const { simulation, link } = panel.choice;
      board.mesh.visible = this.#isPlaced && !panel.element.hidden;
      board.leader.visible = false;
      if (!board.mesh.visible) continue;
      const at = new Vector3();
      const isBound = panel.follows && Boolean(this.view.stations.get(simulation)?.robot?.locate(link, at));
      const place = isBound
        ? at.clone().addScaledVector(UP, (following += 1) * PLOT_HEIGHT_M).addScaledVector(this.#ahead, -BEFORE_M)
        : this.view.world.localToWorld(BOARD.clone()).addScaledVector(UP, -BELOW_M - (docked++) * PLOT_HEIGHT_M);
      board.stand(place, this.#eye);
      board.lead(isBound ? at : null);
      board.show();
    }
  }

  #boardOf(panel) {
    if (!this.#plotBoards.has(panel)) {
      const board = new PlotBoard(panel);
      this.view.room.add(board.mesh, board.leader);
      this.#plotBoards.set(panel, board);
    }
    return this.#plotBoards.get(panel);
  }
}

/** Request a hit test that finds the floor in front of the user; null if the device has none. */
async function findFloor(session) {
  try {
    const space = await session.requestReferenceSpace("viewer");
    return (await session.requestHitTestSource({ space })) ?? null;
  } catch {
    return null;
  }
}

/** Place of the tip of a controller or of a forefinger in the room; null if the input is neither, or its place unknown. */
function placeOf(frame, source, space) {
  if (source.targetRayMode !== "tracked-pointer") return null;
  const finger = source.hand?.get("index-finger-tip");
  const pose = finger ? frame.getJointPose(finger, space) : frame.getPose(source.targetRaySpace, space);
  return pose ? new Vector3().copy(pose.transform.position) : null;
}

/** Pose of an input in the room, along whose negative z axis it points; null if it is unknown. */
function poseOf(frame, source, space) {
  const pose = frame.getPose(source.targetRaySpace, space);
  return pose ? new Matrix4().fromArray(pose.transform.matrix) : null;
}

/** Raycaster along the direction in which an input points; null if that is unknown. */
function rayOf(frame, source, space) {
  const pose = frame.getPose(source.targetRaySpace, space);
  if (!pose) return null;
  const { position, orientation } = pose.transform;
  return new Raycaster(new Vector3().copy(position), new Vector3(0, 0, -1).applyQuaternion(orientation));
}

/** Where the ray of a finger on a screen meets the floor; null if it does not. */
function meetFloor(caster, height) {
  const { origin, direction } = caster?.ray ?? {};
  const away = origin ? (height - origin.y) / direction.y : -1;
  return away > 0 && Number.isFinite(away) ? caster.ray.at(away, new Vector3()) : null;
}
