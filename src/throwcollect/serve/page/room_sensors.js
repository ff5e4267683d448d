/** Sensors in a room: a board with each picture above its sensor, and hands that take a sensor and put it elsewhere. */

import { Matrix4, Vector3 } from "./vendor/three/build/three.module.js";
import { PictureBoard } from "./boards.js";

/** A sensor is taken if the ray of a hand comes this near to it, and this far from the hand [m]. */
const [NEAR_M, REACH_M] = [0.1, 1.5];
const HEIGHT_M = 0.32;
const UP = new Vector3(0, 1, 0);
/** Least time between two changes of a sensor that is held [ms]. */
const PERIOD_MS = 100;

/** Draws the boards, and moves the sensor that each hand holds. */
export class RoomSensors {
  /** @type {Map<string, PictureBoard>} by sensor and stream */
  #boards = new Map();
  /** @type {Map<XRInputSource, {name: string, grip: Matrix4, sentAt: number}>} pose of the sensor in each hand */
  #held = new Map();

  /**
   * @param {import("./scene.js").View} view
   * @param {import("./sensor_strip.js").SensorStrip} strip
   */
  constructor(view, strip) {
    Object.assign(this, { view, strip });
  }

  /** @returns {PictureBoard[]} */
  get boards() {
    return [...this.#boards.values()];
  }

  /** @returns {boolean} whether this hand holds a sensor */
  holds(source) {
    return this.#held.has(source);
  }

  /**
   * @param {import("./vendor/three/build/three.module.js").Ray} ray of a hand
   * @returns {import("./sensor_frames.js").Sensor | undefined} the nearest sensor at which it points and that can be changed
   */
  find(ray) {
    const { strip } = this;
    if (!strip.source || !strip.station?.robot) return undefined;
    const awayOf = (sensor) => {
      const place = new Vector3().setFromMatrixPosition(this.#poseOf(sensor));
      return ray.distanceToPoint(place) < NEAR_M ? place.distanceTo(ray.origin) : Infinity;
    };
    const found = strip.sensors.filter(({ name }) => strip.source.mayChange(name)).map((sensor) => [awayOf(sensor), sensor]);
    const [away, sensor] = found.reduce((best, each) => (each[0] < best[0] ? each : best), [Infinity]);
    return away < REACH_M ? sensor : undefined;
  }

  /**
   * Take the sensor that a hand points at, if there is one.
   * @param {XRInputSource} source
   * @param {import("./vendor/three/build/three.module.js").Ray} ray of the hand
   * @param {Matrix4} hand pose in the room
   */
  take(source, ray, hand) {
    const sensor = this.find(ray);
    if (sensor) this.#held.set(source, { name: sensor.name, grip: hand.clone().invert().multiply(this.#poseOf(sensor)), sentAt: 0 });
  }

  /**
   * Move the sensor in a hand with it; what the sensor sees follows a few times a second.
   * @param {XRInputSource} source
   * @param {Matrix4} hand pose in the room
   * @param {boolean} [isLast] whether the hand lets it go there
   */
  move(source, hand, isLast = false) {
    const held = this.#held.get(source);
    const sensor = this.strip.sensors.find(({ name }) => name === held?.name);
    if (isLast || !sensor) this.#held.delete(source);
    if (!held || !sensor) return;
    this.strip.place(sensor, this.#frame.invert().multiply(hand).multiply(held.grip));
    const now = performance.now();
    if (!isLast && now - held.sentAt < PERIOD_MS) return;
    held.sentAt = now;
    this.strip.source.change(sensor.name, sensor.section);
  }

  /**
   * Show the boards.
   * @param {Vector3} eye of the user in the room [m]
   * @param {boolean} isPlaced whether there are robots in the room
   */
  show(eye, isPlaced) {
    const pictures = this.strip.strands.filter(({ canvas }) => canvas);
    for (const [key, board] of this.#boards) {
      if (pictures.includes(board.strand)) continue;
      board.dispose();
      this.#boards.delete(key);
    }
    const above = new Map();
    for (const strand of pictures) {
      if (!this.#boards.has(strand.key)) {
        const board = new PictureBoard(strand);
        this.view.room.add(board.mesh, board.leader);
        this.#boards.set(strand.key, board);
      }
      const board = this.#boards.get(strand.key);
      const isShown = isPlaced && Boolean(this.strip.station);
      board.mesh.visible = board.leader.visible = isShown;
      if (!isShown) continue;
      const place = new Vector3().setFromMatrixPosition(this.#poseOf(strand.sensor));
      const number = (above.get(strand.sensor.name) ?? 0) + 1;
      above.set(strand.sensor.name, number);
      board.stand(place.clone().addScaledVector(UP, number * HEIGHT_M), eye);
      board.lead(place);
      board.show();
    }
  }

  dispose() {
    for (const board of this.#boards.values()) board.dispose();
    this.#boards.clear();
    this.#held.clear();
  }

  /** @returns {Matrix4} pose of the frame world of the robot that carries the sensors, in the room */
  get #frame() {
    const { group } = this.strip.station;
    group.updateWorldMatrix(true, false);
    return group.matrixWorld.clone();
  }

  #poseOf(sensor) {
    return this.#frame.multiply(this.strip.station.sensors.poseOf(sensor, this.strip.station.robot));
  }
}
