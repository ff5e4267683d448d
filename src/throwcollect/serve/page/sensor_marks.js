/** Sensors in the view: lines that show where each one looks, and the points that lidars see. */

import { BufferAttribute, BufferGeometry, Group, LineBasicMaterial, LineSegments, Matrix4, Points, PointsMaterial, Quaternion, Vector3 } from "./vendor/three/build/three.module.js";
import { linesOf } from "./sensor_frames.js";

const LINES = new LineBasicMaterial({ color: "#e0912f" });
const POINTS = new PointsMaterial({ color: "#d6336c", size: 3, sizeAttenuation: false });

/** Make an empty object that is placed by its matrix. */
function makePlaced(Kind, material, numbers) {
  const object = new Kind(new BufferGeometry().setAttribute("position", new BufferAttribute(numbers, 3)), material);
  object.matrixAutoUpdate = false;
  // The numbers change, and the sphere around them is not computed anew.
  object.frustumCulled = false;
  return object;
}

/** What is drawn of the sensors of one robot, in the frame world. */
export class SensorMarks {
  object = new Group();
  /** @type {Map<string, {sensor: import("./sensor_frames.js").Sensor, lines: LineSegments, points: Points}>} */
  #marks = new Map();

  /** @param {import("./sensor_frames.js").Sensor[]} sensors to draw, in the place of those before */
  put(sensors) {
    this.clear();
    for (const sensor of sensors) {
      const mark = { sensor, lines: makePlaced(LineSegments, LINES, linesOf(sensor)), points: makePlaced(Points, POINTS, new Float32Array()) };
      this.#marks.set(sensor.name, mark);
      this.object.add(mark.lines, mark.points);
    }
  }

  /** @param {boolean} shown whether there are lines */
  showLines(shown) {
    for (const { lines } of this.#marks.values()) lines.visible = shown;
  }

  /**
   * Move all lines to where the links of the robot are.
   * @param {import("./robot.js").Robot | null} robot
   */
  follow(robot) {
    for (const { sensor, lines } of this.#marks.values()) lines.matrix.copy(this.poseOf(sensor, robot));
  }

  /**
   * @param {string} name of a sensor
   * @param {Float32Array} points that it sees in its frame [m], while the robot is as it is
   * @param {import("./robot.js").Robot | null} robot
   */
  setPoints(name, points, robot) {
    const mark = this.#marks.get(name);
    if (!mark) return;
    mark.points.geometry.dispose();
    mark.points.geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(points, 3));
    mark.points.matrix.copy(this.poseOf(mark.sensor, robot));
  }

  clear() {
    for (const { lines, points } of this.#marks.values()) {
      lines.geometry.dispose();
      points.geometry.dispose();
    }
    this.#marks.clear();
    this.object.clear();
  }

  /**
   * @param {import("./sensor_frames.js").Sensor} sensor
   * @param {import("./robot.js").Robot | null} robot
   * @returns {Matrix4} pose of the sensor in the frame world
   */
  poseOf({ position_m: place, rotation_xyzw: turn, section }, robot) {
    const pose = new Matrix4().compose(new Vector3(...place), new Quaternion(...turn), new Vector3(1, 1, 1));
    const link = robot?.poseOf(section.link);
    return link ? link.multiply(pose) : pose;
  }
}
