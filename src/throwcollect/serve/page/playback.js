/** Replays the newest throw of each simulation again and again, until a newer one follows at its end. */

const REST_S = 0.7;
/** Longest step between two pictures, so that a page that was hidden does not catch up. */
const LONGEST_STEP_S = 0.2;

/** @typedef {import("./throws.js").Throw} Throw */

/** Keeps the time in each throw that is replayed, one for each simulation. */
export class Playback {
  playing = true;
  speed = 1;
  /** @type {Map<string, {shown: Throw, time: number, next: Throw | null}>} */
  #tracks = new Map();

  /** @param {(shown: Throw) => void} began called with each throw whose replay begins */
  constructor(began) {
    this.began = began;
  }

  /** @param {Throw} newest */
  put(newest) {
    const track = this.#tracks.get(newest.simulation);
    if (track === undefined || (!this.playing && track.time >= track.shown.duration)) this.#begin(newest);
    else track.next = newest;
  }

  /** @param {Throw} shown is replayed at once, in place of the throw before */
  show(shown) {
    this.#begin(shown);
  }

  /** Forget all throws. */
  clear() {
    this.#tracks.clear();
  }

  /**
   * @param {string} simulation
   * @returns {{shown: Throw, time: number} | undefined}
   */
  at(simulation) {
    const track = this.#tracks.get(simulation);
    return track && { shown: track.shown, time: Math.min(track.time, track.shown.duration) };
  }

  /** @param {number} seconds that have passed */
  step(seconds) {
    if (!this.playing) return;
    for (const track of this.#tracks.values()) {
      track.time += Math.min(seconds, LONGEST_STEP_S) * this.speed;
      if (track.time < track.shown.duration + REST_S * this.speed) continue;
      if (track.next) this.#begin(track.next);
      else track.time = 0;
    }
  }

  /** @param {number} time [s] of all throws, which stand still from then on */
  seek(time) {
    this.playing = false;
    for (const track of this.#tracks.values()) track.time = Math.min(time, track.shown.duration);
  }

  #begin(shown) {
    this.#tracks.set(shown.simulation, { shown, time: this.playing ? 0 : shown.duration, next: null });
    this.began(shown);
  }
}
