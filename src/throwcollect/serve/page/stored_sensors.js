/** The sensors of the stored throw that is replayed, and cameras that the user adds to it. */

import { REPLAY } from "./replay.js";
import { frameAt, paint, pointsOf } from "./sensor_frames.js";
import { jointsAt } from "./throws.js";

/** Frames that are kept of a throw; the oldest ones go first. */
const MOST_KEPT = 400;

/** Fetches what sensors saw of the stored throw, and what added cameras see of it. */
export class StoredSensors {
  station = REPLAY;
  /** @type {import("./throws.js").Throw | null} */
  #throw = null;
  #path = "";
  /** @type {Map<string, Uint8ClampedArray | Float32Array>} */
  #kept = new Map();
  /** @type {import("./sensor_frames.js").Sensor[]} those of the dataset */
  #recorded = [];
  /** @type {Map<string, {section: object, sensor: import("./sensor_frames.js").Sensor | null, asked: string}>} cameras that are not recorded */
  #added = new Map();
  #isAsking = false;

  /**
   * @param {object} parts
   * @param {import("./connection.js").Connection} parts.connection
   * @param {import("./playback.js").Playback} parts.playback
   * @param {import("./replay.js").Replay} parts.replay
   * @param {import("./sensor_strip.js").SensorStrip} parts.strip
   */
  constructor({ connection, playback, replay, strip }) {
    Object.assign(this, { connection, playback, replay, strip });
  }

  /** See `Source`; what is recorded cannot be changed. */
  mayChange(name) {
    return this.#added.has(name);
  }

  /** See `Source`. */
  change(name, section) {
    if (section) this.#added.set(name, { sensor: null, asked: "", ...this.#added.get(name), section });
    else if (this.#added.delete(name)) this.#put();
  }

  /** Show the frames of the time of the replay; called for each picture of the view. */
  follow() {
    const { shown } = this.replay;
    if (shown !== this.#throw) this.#begin(shown);
    const at = this.playback.at(REPLAY);
    if (this.strip.source !== this || !at || at.shown !== shown || !this.strip.station) return;
    for (const strand of this.strip.strands) if (!this.#added.has(strand.sensor.name)) this.#show(strand, frameAt(strand.sensor.time_s, at.time));
    this.#render(at.time);
  }

  async #begin(shown) {
    this.#throw = shown;
    this.#kept.clear();
    this.#path = shown ? this.replay.path : "";
    let sensors = [];
    if (shown) {
      try {
        sensors = await this.connection.read("GET", `${this.#path}/sensors`);
      } catch (error) {
        this.replay.tell(`sensors: ${error.message}`);
      }
      if (shown !== this.#throw) return;
    } else if (this.strip.source === this) {
      this.strip.put(null, []);
    }
    this.#recorded = sensors;
    // A recorded sensor takes the name of a camera that was added to another throw.
    for (const { name } of sensors) this.#added.delete(name);
    if (shown) this.#put();
    if (this.strip.source === this) for (const strand of this.strip.strands) Object.assign(strand, { shown: -1, isAsking: false });
  }

  #put() {
    this.strip.put(this, [...this.#recorded, ...[...this.#added.values()].map(({ sensor }) => sensor).filter(Boolean)]);
    // Points are drawn again, as the marks are new.
    for (const strand of this.strip.strands) if (!strand.canvas) strand.shown = -1;
  }

  /** Show a frame, or ask for it; one frame of each stream is asked for at a time. */
  async #show(strand, number) {
    if (number < 0 || number === strand.shown) return;
    const { sensor, stream, canvas } = strand;
    const key = `${strand.key}/${number}`;
    const content = this.#kept.get(key);
    if (content) {
      strand.shown = number;
      if (canvas) strand.draw(content, sensor.section);
      else this.#setPoints(sensor, number, content);
      return;
    }
    if (strand.isAsking) return;
    strand.isAsking = true;
    const asked = this.#throw;
    try {
      const buffer = await (await this.connection.ask("GET", `${this.#path}/sensors/${key}`)).arrayBuffer();
      if (asked !== this.#throw) return;
      this.#kept.set(key, canvas ? paint(stream, buffer, canvas.width * canvas.height) : pointsOf(sensor, buffer));
      if (this.#kept.size > MOST_KEPT) this.#kept.delete(this.#kept.keys().next().value);
      strand.isAsking = false;
      await this.#show(strand, number);
    } catch (error) {
      // The strand keeps asking for nothing, until the next throw.
      this.replay.tell(`${key}: ${error.message}`);
    }
  }

  /** Put points where the sensor was when it saw them, which may be a little before the time of the replay. */
  #setPoints(sensor, number, points) {
    const { robot, sensors } = this.strip.station;
    const pose = (time) => robot?.move(jointsAt(this.#throw, time).map((position, i) => [this.#throw.joints[i], position]));
    pose(sensor.time_s[number]);
    sensors.setPoints(sensor.name, points, robot);
    pose(this.playback.at(REPLAY).time);
    this.strip.view.touch();
  }

  /** Ask for the picture of an added camera that has changed, or whose time has; the server lets each picture wait. */
  async #render(time) {
    if (this.#isAsking) return;
    for (const [name, camera] of this.#added) {
      const { section } = camera;
      const wanted = JSON.stringify([this.#path, section, time]);
      if (wanted === camera.asked) continue;
      camera.asked = wanted;
      if (!camera.sensor) this.strip.tell("waiting for the picture …");
      this.#isAsking = true;
      try {
        const answer = await this.connection.ask("POST", `${this.#path}/picture`, { camera: section, time_s: time });
        const sensor = { ...JSON.parse(answer.headers.get("Sensor")), name };
        const pixels = await answer.arrayBuffer();
        if (this.strip.source !== this || !this.#added.has(name)) return;
        const isMoved = JSON.stringify(camera.sensor?.section) !== JSON.stringify(sensor.section);
        camera.sensor = sensor;
        if (isMoved) this.#put();
        const { width, height } = sensor.section;
        this.strip.strands.find((strand) => strand.sensor.name === name)?.draw(paint("color", pixels, width * height), sensor.section);
        this.strip.tell("");
      } catch (error) {
        this.strip.tell(error.message);
      } finally {
        this.#isAsking = false;
      }
    }
  }
}
