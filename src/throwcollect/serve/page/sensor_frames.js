/** Frames of sensors as the server sends them: pictures, points, lines of a view, and sections of a configuration. */

/**
 * @typedef {object} Sensor
 * @property {string} name
 * @property {[number, number, number]} position_m place in its link; it looks along x, with y to its left
 * @property {[number, number, number, number]} rotation_xyzw
 * @property {string[]} streams color, depth, segmentation, scan or points
 * @property {number[]} time_s time of each frame since the start of the throw
 * @property {Record<string, any>} section what is below its name in a configuration
 */

/** Length of the lines of a view [m]. */
const FRUSTUM_M = 0.5;
/** Words that YAML reads as something else than a string. */
const NO_STRINGS = new Set(["y", "n", "yes", "no", "on", "off", "true", "false", "null"]);

/**
 * @param {number[]} times of frames [s], in order
 * @param {number} time [s]
 * @returns {number} the newest frame at that time; the first one before it, -1 if there is none
 */
export function frameAt(times, time) {
  let found = Math.min(0, times.length - 1);
  // A time of the replay may be a rounding error before that of the frame.
  while (found + 1 < times.length && times[found + 1] <= time + 1e-6) found += 1;
  return found;
}

/** @returns {number} a hue that differs from those of the numbers before [degrees] */
const hueOf = (label) => (label * 137.508) % 360;

/** One of the numbers red, green, blue [0 to 255] of a hue, with `at` 0, 8 and 4. */
function channel(hue, at) {
  const k = (at + hue / 30) % 12;
  return Math.round(255 * (0.55 - 0.35 * Math.max(-1, Math.min(k - 3, 9 - k, 1))));
}

/** Red, green and blue of each pixel of a stream, from its index. */
const PAINTERS = {
  color(buffer) {
    const values = new Uint8Array(buffer);
    return (at) => [values[3 * at], values[3 * at + 1], values[3 * at + 2]];
  },
  /** Near is light; black is nothing. */
  depth(buffer) {
    const values = new Float32Array(buffer);
    const seen = values.filter(Number.isFinite);
    const near = seen.reduce((least, each) => Math.min(least, each), Infinity);
    const far = seen.reduce((most, each) => Math.max(most, each), near);
    return (at) => {
      const grey = Number.isFinite(values[at]) ? 255 - (200 * (values[at] - near)) / (far - near || 1) : 0;
      return [grey, grey, grey];
    };
  },
  segmentation(buffer) {
    const values = new Uint16Array(buffer);
    // 0 is the background.
    return (at) => (values[at] ? [0, 8, 4].map((part) => channel(hueOf(values[at]), part)) : [0, 0, 0]);
  },
};

/**
 * Paint a picture.
 * @param {string} stream color, depth or segmentation
 * @param {ArrayBuffer} buffer numbers of its pixels, row by row
 * @param {number} count of pixels
 * @returns {Uint8ClampedArray} red, green, blue and opacity of each pixel
 */
export function paint(stream, buffer, count) {
  const colorOf = PAINTERS[stream](buffer);
  const pixels = new Uint8ClampedArray(4 * count);
  for (let at = 0; at < count; at++) {
    const [red, green, blue] = colorOf(at);
    pixels[4 * at] = red;
    pixels[4 * at + 1] = green;
    pixels[4 * at + 2] = blue;
    pixels[4 * at + 3] = 255;
  }
  return pixels;
}

/**
 * @param {Sensor} sensor a lidar
 * @param {ArrayBuffer} buffer a frame of it
 * @returns {Float32Array} x, y, z of each point in the frame of the sensor [m]
 */
export function pointsOf({ streams, section }, buffer) {
  const values = new Float32Array(buffer);
  const points = [];
  if (streams.includes("points")) {
    for (let at = 0; at < values.length; at += 4) if (Number.isFinite(values[at])) points.push(...values.subarray(at, at + 3));
  } else {
    const span = section.to_rad - section.from_rad;
    // A whole turn ends one step before it begins anew.
    const step = span / (span > 6.283 ? values.length : Math.max(values.length - 1, 1));
    values.forEach((range, ray) => {
      const angle = section.from_rad + ray * step;
      if (Number.isFinite(range)) points.push(range * Math.cos(angle), range * Math.sin(angle), 0);
    });
  }
  return Float32Array.from(points);
}

/**
 * @param {Sensor} sensor
 * @returns {Float32Array} x, y, z of the ends of each line of its view, in its frame [m]; of a lidar, of its axes x and z
 */
export function linesOf({ section }) {
  const eye = [0, 0, 0];
  if (section.vertical_fov_rad === undefined) return Float32Array.from([...eye, 0.2, 0, 0, ...eye, 0, 0, 0.1]);
  const up = Math.tan(section.vertical_fov_rad / 2);
  const aside = (up * section.width) / section.height;
  // Views of more than a right angle get shorter, so that they do not fill the scene.
  const length = FRUSTUM_M / Math.max(1, up, aside);
  const corners = [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([y, z]) => [length, y * aside * length, z * up * length]);
  const top = [length, 0, 1.3 * up * length];
  const lines = corners.flatMap((corner, i) => [eye, corner, corner, corners[(i + 1) % 4]]);
  // A roof shows which side is up.
  return Float32Array.from([...lines, corners[0], top, top, corners[1]].flat());
}

/**
 * @param {[number, number, number, number]} turn as x, y, z, w
 * @returns {[number, number, number]} rotations about the fixed axes x, y, z, in this order [rad]
 */
export function rpyOf([x, y, z, w]) {
  return [
    Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
    Math.asin(Math.max(-1, Math.min(1, 2 * (w * y - z * x)))),
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
  ];
}

/** @returns {number[]} the point 1 m in front of a sensor with these angles [m] */
export function aimAlong([x, y, z], [, pitch, yaw]) {
  return [x + Math.cos(pitch) * Math.cos(yaw), y + Math.cos(pitch) * Math.sin(yaw), z - Math.sin(pitch)];
}

/** @returns {number[]} angles of a sensor that looks at a point, with its z upwards [rad] */
export function anglesTo([x, y, z], [atX, atY, atZ]) {
  return [0, Math.atan2(z - atZ, Math.hypot(atX - x, atY - y)), Math.atan2(atY - y, atX - x)];
}

function write(value) {
  if (Array.isArray(value)) return `[${value.map(write).join(", ")}]`;
  if (typeof value === "number") return String(Number(value.toPrecision(6)));
  if (typeof value === "string") return /^[a-z_]\w*$/i.test(value) && !NO_STRINGS.has(value.toLowerCase()) ? value : JSON.stringify(value);
  if (typeof value !== "object") return String(value);
  return `{${Object.entries(value).filter(([, each]) => each !== null).map(([key, each]) => `${key}: ${write(each)}`).join(", ")}}`;
}

/**
 * @param {string} name of a sensor
 * @param {Record<string, any>} section
 * @returns {string} it in YAML, as it stands in a configuration; keys that are null are left out
 */
export function toYaml(name, section) {
  return `sensors:\n  ${name}: ${write(section)}\n`;
}
