/** Finished throws as the server sends them: decoding, and the places of joints and bodies at a time. */

/**
 * @typedef {object} Throw
 * @property {number} trial
 * @property {string} simulation
 * @property {string} outcome
 * @property {string[]} joints
 * @property {number} samples
 * @property {number} rate_hz
 * @property {[number, number, number] | null} landing [m], frame world
 * @property {Record<string, unknown>} values swept keys and their values
 * @property {import("./bodies.js").Body[]} bodies that stood around the robot
 * @property {Float32Array} positions [rad], joints of a sample side by side
 * @property {Float32Array} path centre of the object [m], frame world, x y z of a sample side by side
 * @property {Float32Array} moved centres [m] and quaternions of the bodies that move, the object last, 7 numbers each, frame world
 * @property {number} duration [s]
 */

/**
 * Decode a message: length of the header, header, padding to 4 bytes, positions of joints, positions of the object, poses of bodies.
 * @param {ArrayBuffer} buffer
 * @returns {Throw}
 * @throws {RangeError} if it is shorter than its header says
 */
export function decodeThrow(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const start = 4 + Math.ceil(length / 4) * 4;
  const { samples, joints } = header;
  // Typed arrays need the byte order of the machine; all machines with a browser are little-endian, as the message is.
  const positions = new Float32Array(buffer, start, samples * joints.length);
  const path = new Float32Array(buffer, start + positions.byteLength, samples * 3);
  const moved = new Float32Array(buffer, path.byteOffset + path.byteLength);
  return { ...header, positions, path, moved, duration: Math.max(0, samples - 1) / header.rate_hz };
}

/**
 * @param {Float32Array} values rows side by side
 * @param {number} width values of a row
 * @param {Throw} shown
 * @param {number} time [s]
 * @returns {number[]} the row at that time, interpolated between the samples before and after it
 */
function valuesAt(values, width, shown, time) {
  const at = Math.min(Math.max(time * shown.rate_hz, 0), shown.samples - 1);
  const before = Math.floor(at);
  const after = Math.min(before + 1, shown.samples - 1);
  const share = at - before;
  return Array.from({ length: width }, (_, i) => values[before * width + i] * (1 - share) + values[after * width + i] * share);
}

/**
 * @param {Throw} shown
 * @param {number} time [s]
 * @returns {number[]} positions of its joints [rad]
 */
export function jointsAt(shown, time) {
  return valuesAt(shown.positions, shown.joints.length, shown, time);
}

/**
 * @param {Throw} shown
 * @param {number} time [s]
 * @returns {number[][]} centre and quaternion of each body that moves, at the sample before
 */
export function posesAt(shown, time) {
  const width = shown.moved.length / shown.samples;
  const row = Math.min(Math.floor(time * shown.rate_hz), shown.samples - 1) * width;
  return Array.from({ length: width / 7 }, (_, i) => [...shown.moved.slice(row + 7 * i, row + 7 * i + 7)]);
}

/**
 * One number of each sample: of the object, of a joint, or the velocity of a joint as the slope of its positions.
 * @param {Throw} shown
 * @param {"position" | "velocity" | "effort" | "ball"} field
 * @param {string} name of a joint, or x, y, z
 * @returns {Float64Array | null} null if throws do not contain this field
 */
export function seriesOf(shown, field, name) {
  const width = field === "ball" ? 3 : shown.joints.length;
  const column = field === "ball" ? "xyz".indexOf(name) : shown.joints.indexOf(name);
  if (column < 0 || field === "effort") return null;
  const values = field === "ball" ? shown.path : shown.positions;
  const series = Float64Array.from({ length: shown.samples }, (_, i) => values[i * width + column]);
  if (field !== "velocity") return series;
  const last = shown.samples - 1;
  return series.map((_, i) => {
    const [from, to] = [Math.max(i - 1, 0), Math.min(i + 1, last)];
    return to > from ? ((series[to] - series[from]) * shown.rate_hz) / (to - from) : 0;
  });
}

/**
 * @param {Throw} shown
 * @returns {string} the joint that moves most: whose greatest and least position differ most
 */
export function widestJoint(shown) {
  const ranges = shown.joints.map((joint) => {
    const series = seriesOf(shown, "position", joint);
    return Math.max(...series) - Math.min(...series);
  });
  return shown.joints[ranges.indexOf(Math.max(...ranges))];
}
