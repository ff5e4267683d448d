/** The strip of sensors below the view: their pictures, their marks in the view, and a form that changes one of them. */

import { Matrix4, Quaternion, Vector3 } from "./vendor/three/build/three.module.js";
import { get, make, makeButton, setText } from "./dom.js";
import { SensorForm } from "./sensor_form.js";
import { rpyOf, toYaml } from "./sensor_frames.js";

/** @typedef {import("./sensor_frames.js").Sensor} Sensor */
/**
 * @typedef {object} Source what the sensors of the strip see: a stored throw, or a simulation
 * @property {string} station whose robot carries them
 * @property {(name: string) => boolean} mayChange whether a sensor can be changed and removed
 * @property {(name: string, section: object | null) => void} change adds or changes a sensor; null removes it
 */

const FIRST = { kind: "camera", link: "world", position_m: [1, -3, 1.5], look_at_m: [0.6, 0, 1], width: 160, height: 120, vertical_fov_rad: 1.05 };
const round = (value) => Number(value.toFixed(4));

/** One stream of one sensor. */
export class Strand {
  /** Number of the frame that is shown; -1 for none. */
  shown = -1;
  isAsking = false;
  /** Number of pictures that were drawn. */
  drawn = 0;

  /**
   * @param {Sensor} sensor
   * @param {string} stream
   */
  constructor(sensor, stream) {
    Object.assign(this, { sensor, stream, key: `${sensor.name}/${stream}` });
    const isPicture = sensor.section.width !== undefined;
    /** Null if its frames are points. */
    this.canvas = isPicture ? make("canvas", { width: sensor.section.width, height: sensor.section.height, role: "img", "aria-label": `${stream} of ${sensor.name}` }) : null;
  }

  /**
   * @param {Uint8ClampedArray} pixels red, green, blue and opacity of each
   * @param {{width: number, height: number}} size
   */
  draw(pixels, { width, height }) {
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    this.canvas.getContext("2d").putImageData(new ImageData(pixels, width, height), 0, 0);
    this.drawn += 1;
  }
}

/** Shows the sensors of one source at a time. */
export class SensorStrip {
  /** @type {Strand[]} */
  strands = [];
  /** @type {Sensor[]} */
  sensors = [];
  /** @type {Source | null} */
  source = null;
  /** Whether there are lines even if the user has not asked for them. */
  #isInRoom = false;
  #hasLines = false;
  #chosen = "";
  /** The station whose marks are those of the sensors. */
  #marked = null;

  /** @param {import("./scene.js").View} view */
  constructor(view) {
    this.view = view;
    this.form = new SensorForm(get("sensor-form"), {
      changed: (section) => this.source.change(this.#chosen, section),
      copied: (section) => this.#copy(this.#chosen, section),
      removed: () => {
        this.source.change(this.#chosen, null);
        this.#choose("");
      },
      closed: () => this.#choose(""),
    });
    get("frustum").addEventListener("click", () => {
      this.#hasLines = !this.#hasLines;
      get("frustum").setAttribute("aria-pressed", String(this.#hasLines));
      this.#showLines();
    });
    get("add-camera").addEventListener("click", () => this.add());
  }

  /** @returns {import("./scene.js").Station | undefined} */
  get station() {
    return this.view.stations.get(this.source?.station);
  }

  /** @param {string} text what is wrong, or was done */
  tell(text) {
    setText(get("sensors-note"), text);
  }

  /**
   * Show sensors in the place of those before; pictures of streams that the same source still has stay.
   * @param {Source | null} source null for none
   * @param {Sensor[]} sensors
   */
  put(source, sensors) {
    if (source !== this.source) {
      this.station?.sensors.clear();
      this.strands = [];
      this.#choose("");
      this.tell("");
    }
    const before = new Map(this.strands.map((strand) => [strand.key, strand]));
    const had = this.sensors.some(({ name }) => name === this.#chosen);
    Object.assign(this, { source, sensors });
    this.strands = sensors.flatMap((sensor) => sensor.streams.map((stream) => {
      const strand = before.get(`${sensor.name}/${stream}`) ?? new Strand(sensor, stream);
      strand.sensor = sensor;
      strand.figure ??= this.#makeFigure(strand);
      return strand;
    }));
    get("sensors").hidden = source === null;
    const place = get("pictures");
    const figures = this.strands.map(({ figure }) => figure);
    if (figures.length !== place.children.length || figures.some((figure, i) => figure !== place.children[i])) place.replaceChildren(...figures);
    const chosen = sensors.find(({ name }) => name === this.#chosen);
    if (chosen) this.form.put(chosen);
    else if (had) this.#choose("");
    this.#mark();
  }

  /** Move marks to where the robot is; called for each picture of the view. */
  follow() {
    const { station } = this;
    if (!station) return;
    if (this.#marked !== station) this.#mark();
    station.sensors.follow(station.robot);
    if (this.#chosen) this.form.offer(station.robot?.links ?? []);
  }

  /**
   * Add a camera, which looks at the robot, with a name that no other sensor has.
   * @param {number[]} [place] of it [m], frame world
   */
  add(place = FIRST.position_m) {
    const names = new Set(this.sensors.map(({ name }) => name));
    let name = "camera";
    for (let number = 2; names.has(name); number++) name = `camera_${number}`;
    const section = { ...FIRST, position_m: place.map(round) };
    this.source.change(name, section);
    this.#choose(name, { name, section });
  }

  /**
   * Put a sensor somewhere.
   * @param {Sensor} sensor
   * @param {Matrix4} pose in the frame of its station
   */
  place(sensor, pose) {
    const link = this.station.robot?.poseOf(sensor.section.link);
    const [place, turn] = [new Vector3(), new Quaternion()];
    (link ? link.invert().multiply(pose) : pose).decompose(place, turn, new Vector3());
    const [position_m, rotation_xyzw] = [place.toArray().map(round), turn.toArray()];
    // It is drawn there at once; what comes back from the source is the same.
    Object.assign(sensor, { position_m, rotation_xyzw, section: { ...sensor.section, position_m, look_at_m: null, rpy_rad: rpyOf(rotation_xyzw).map(round) } });
    if (sensor.name === this.#chosen) this.form.put(sensor);
  }

  /** @param {boolean} isInRoom whether the view is in a room, where all sensors have lines */
  enter(isInRoom) {
    this.#isInRoom = isInRoom;
    this.#showLines();
  }

  /**
   * @param {string} name of the sensor that the form changes; empty for none
   * @param {Sensor} [sensor] as it is
   */
  #choose(name, sensor) {
    this.#chosen = name;
    get("sensor-form").hidden = !name;
    if (sensor) this.form.put(sensor);
  }

  #showLines() {
    this.station?.sensors.showLines(this.#hasLines || this.#isInRoom);
    this.view.touch();
  }

  #mark() {
    const { station } = this;
    this.#marked = station ?? null;
    if (!station) return;
    station.sensors.put(this.sensors);
    this.#showLines();
  }

  #makeFigure(strand) {
    const { canvas, stream, sensor: { name } } = strand;
    const buttons = [makeButton("YAML", () => this.#copy(name, strand.sensor.section), { title: `copy ${name} as YAML` })];
    if (this.source.mayChange(name)) buttons.push(makeButton("Change", () => this.#choose(name, strand.sensor), { title: `change or remove ${name}` }));
    return make("figure", {}, ...(canvas ? [canvas] : []), make("figcaption", {}, `${name}: ${canvas ? stream : "points in the view"} `, ...buttons));
  }

  async #copy(name, section) {
    const text = toYaml(name, section);
    try {
      await navigator.clipboard.writeText(text);
      this.tell(`${name} is copied as YAML`);
    } catch {
      this.tell(text);
    }
  }
}
