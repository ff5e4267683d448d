/** The state of everything, as the server tells it: always whole, so that only the newest message matters. */

/**
 * @typedef {object} Component
 * @property {string} name
 * @property {string} pretty_name
 * @property {"collection" | "session" | "container"} kind
 * @property {number} max_instances
 * @property {string[]} instances ids of those that live
 * @property {string[]} targets keys that a request may set in sweep.target; none if its throws cannot be aimed
 */

/**
 * @typedef {object} Progress
 * @property {number} total
 * @property {number} ended
 * @property {Record<string, number>} outcomes
 * @property {number} throws_per_s
 * @property {number | null} wanted
 * @property {string} success
 * @property {string} noun
 */

/**
 * @typedef {object} Instance
 * @property {string} id
 * @property {string | null} component
 * @property {string} name
 * @property {"collection" | "session" | "container"} kind
 * @property {string | null} joins id of the run that a container has joined
 * @property {"starting" | "running" | "ended" | "died"} status
 * @property {string} started
 * @property {string | null} ended
 * @property {boolean} stopping whether it has been asked to stop
 * @property {string} message the error with which it ended; empty if there was none
 * @property {number} simulations
 * @property {{name: string, status: string, restarts: number, last_end: string | null}[]} nodes
 * @property {Progress | null} progress
 * @property {string | null} dataset
 * @property {object | null} summary what its dataset holds; null if it is not finished
 * @property {string[]} robots names of its simulations that run
 * @property {boolean} can_be_resumed whether it ended before its last trial
 */

/** @typedef {{components: Component[], instances: Instance[], revision: number}} State */

/**
 * @param {Instance} instance
 * @returns {boolean} whether it is starting or runs
 */
export function lives(instance) {
  return ["starting", "running"].includes(instance.status);
}

/**
 * Runs that can be watched. Containers are left out, because they have no simulations to show, even if one began last.
 * @param {Instance[]} instances
 * @param {(string | null)[]} kept ids of runs that the user has asked for, which are included in any case
 * @returns {string[]} ids
 */
export function watchable(instances, kept) {
  return instances.filter((each) => (lives(each) && each.kind !== "container") || kept.includes(each.id)).map(({ id }) => id);
}

/**
 * How far a collection has come: in successes if a number of them is wanted, else in trials.
 * @param {Progress} progress
 * @returns {[number, number]} steps done, and all
 */
export function steps({ ended, total, wanted, outcomes, success }) {
  return wanted === null ? [ended, total] : [Math.min(outcomes[success] ?? 0, wanted), wanted];
}

/**
 * Names of simulations in the order of their numbers.
 * @param {string[]} names
 * @returns {string[]}
 */
export function inOrder(names) {
  return [...names].sort((a, b) => a.localeCompare(b, "en", { numeric: true }));
}
