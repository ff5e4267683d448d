/** The strip of sensors below the replay of a stored throw: what each camera saw, and where each sensor looked. */

import { AddedCamera } from "./added_camera.js";
import { get, make, makeButton, setText } from "./dom.js";
import { REPLAY } from "./replay.js";
import { frameAt, paint, pointsOf, toYaml } from "./sensor_frames.js";
import { jointsAt } from "./throws.js";

/** Frames that are kept of a throw; the oldest ones go first. */
const MOST_KEPT = 400;

/** One stream of one sensor in the strip. */
class Strand {
  /** Number of the frame that is shown; -1 for none. */
  shown = -1;
  isAsking = false;

  /**
   * @param {import("./sensor_frames.js").Sensor} sensor
   * @param {string} stream
   */
  constructor(sensor, stream) {
    Object.assign(this, { sensor, stream });
    const { width, height } = sensor.section;
    /** Null if its frames are points. */
    this.canvas = width === undefined ? null : make("canvas", { width, height, role: "img", "aria-label": `${stream} of ${sensor.name}` });
  }
}

/** Shows the sensors of the stored throw that is replayed. */
export class Sensors {
  /** @type {Strand[]} */
  strands = [];
  /** @type {import("./throws.js").Throw | null} */
  #throw = null;
  #path = "";
  /** @type {Map<string, Uint8ClampedArray | Float32Array>} */
  #kept = new Map();
  #sensors = [];
  #hasLines = false;

  /**
   * @param {object} parts
   * @param {import("./connection.js").Connection} parts.connection
   * @param {import("./scene.js").View} parts.view
   * @param {import("./playback.js").Playback} parts.playback
   * @param {import("./replay.js").Replay} parts.replay
   */
  constructor({ connection, view, playback, replay }) {
    Object.assign(this, { connection, view, playback, replay });
    this.camera = new AddedCamera({ connection, copy: (name, section) => this.#copy(name, section), changed: () => this.#mark() });
    get("frustum").addEventListener("click", () => {
      this.#hasLines = !this.#hasLines;
      get("frustum").setAttribute("aria-pressed", String(this.#hasLines));
      this.#station?.sensors.showLines(this.#hasLines);
      this.view.touch();
    });
  }

  /** Show the frames of the time of the replay; called for each picture of the view. */
  follow() {
    const { shown } = this.replay;
    if (shown !== this.#throw) this.#begin(shown);
    const at = this.playback.at(REPLAY);
    const station = this.#station;
    if (get("sensors").hidden || !at || at.shown !== shown || !station) return;
    if (this.#marked !== station) this.#mark();
    station.sensors.follow(station.robot);
    for (const strand of this.strands) this.#show(strand, frameAt(strand.sensor.time_s, at.time));
    this.camera.follow(this.#path, at.time, station.robot);
  }

  get #station() {
    return this.view.stations.get(REPLAY);
  }

  /** The station whose marks are those of the throw. */
  #marked = null;

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
    }
    this.#sensors = sensors;
    // A throw after another one of the same run has the same streams, so that nothing moves in the strip.
    this.strands = sensors.flatMap((sensor) => sensor.streams.map((stream) => new Strand(sensor, stream)));
    get("sensors").hidden = !sensors.length;
    get("pictures").replaceChildren(...this.strands.map((strand) => this.#makeFigure(strand)));
    this.#mark();
  }

  #makeFigure({ sensor, stream, canvas }) {
    const what = canvas ? stream : "points in the view";
    const button = makeButton("YAML", () => this.#copy(sensor.name, sensor.section), { title: `copy ${sensor.name} as YAML` });
    return make("figure", {}, ...(canvas ? [canvas] : []), make("figcaption", {}, `${sensor.name}: ${what} `, button));
  }

  /** Draw lines for the sensors of the throw, and for the camera that was added. */
  #mark() {
    const station = this.#station;
    this.#marked = station ?? null;
    if (!station) return;
    const { summary } = this.camera;
    station.sensors.put([...this.#sensors, ...(summary && this.#sensors.length ? [summary] : [])]);
    station.sensors.showLines(this.#hasLines);
    for (const strand of this.strands) if (!strand.canvas) strand.shown = -1;
    this.view.touch();
  }

  /** Show a frame, or ask for it; one frame of each stream is asked for at a time. */
  async #show(strand, number) {
    if (number < 0 || number === strand.shown) return;
    const { sensor, stream, canvas } = strand;
    const key = `${sensor.name}/${stream}/${number}`;
    const content = this.#kept.get(key);
    if (content) {
      strand.shown = number;
      if (canvas) canvas.getContext("2d").putImageData(new ImageData(content, canvas.width, canvas.height), 0, 0);
      else this.#setPoints(sensor, number, content);
      return;
    }
    if (strand.isAsking) return;
    strand.isAsking = true;
    try {
      const buffer = await (await this.connection.ask("GET", `${this.#path}/sensors/${key}`)).arrayBuffer();
      if (!this.strands.includes(strand)) return;
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
    const { robot, sensors } = this.#station;
    const pose = (time) => robot?.move(jointsAt(this.#throw, time).map((position, i) => [this.#throw.joints[i], position]));
    pose(sensor.time_s[number]);
    sensors.setPoints(sensor.name, points, robot);
    pose(this.playback.at(REPLAY).time);
    this.view.touch();
  }

  async #copy(name, section) {
    const text = toYaml(name, section);
    try {
      await navigator.clipboard.writeText(text);
      setText(get("sensors-note"), `${name} is copied as YAML`);
    } catch {
      setText(get("sensors-note"), text);
    }
  }
}
