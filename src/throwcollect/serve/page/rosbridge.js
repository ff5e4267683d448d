/** A small client of rosbridge v2 that subscribes to topics and publishes them. */

const PERIOD_MS = 33;

/** A connection to the ROS graph of one run. */
export class Rosbridge {
  #socket;
  #topics = new Map();
  #advertised = new Map();
  /** @type {Map<string, {resolve: (values: any) => void, reject: (error: Error) => void}>} calls without an answer yet */
  #calls = new Map();
  #open = false;

  /**
   * @param {import("./connection.js").Connection} connection
   * @param {string} run id of the run
   * @param {object} events
   * @param {() => void} [events.opened]
   * @param {() => void} [events.lost]
   * @param {(text: string) => void} [events.refused] called with the reason why something was not published
   */
  constructor(connection, run, events = {}) {
    this.#socket = connection.openRosbridge(run, {
      opened: () => {
        this.#open = true;
        for (const [topic, { type, period }] of this.#topics) this.#ask(topic, type, period);
        for (const [topic, type] of this.#advertised) this.#announce(topic, type);
        events.opened?.();
      },
      receive: (text) => this.#take(JSON.parse(text), events),
      lost: () => {
        this.#open = false;
        for (const { reject } of this.#calls.values()) reject(new Error("the connection to the run is lost"));
        this.#calls.clear();
        events.lost?.();
      },
    });
  }

  /**
   * Subscribe to a topic, again after the connection was lost.
   * @param {string} topic
   * @param {string} type such as std_msgs/msg/String
   * @param {(message: any) => void} hear
   * @param {number} [period] least time between two messages [ms]
   */
  subscribe(topic, type, hear, period = PERIOD_MS) {
    this.#topics.set(topic, { type, hear, period });
    if (this.#open) this.#ask(topic, type, period);
  }

  /** @param {string} topic to unsubscribe from */
  unsubscribe(topic) {
    if (this.#topics.delete(topic)) this.#send({ op: "unsubscribe", topic });
  }

  /**
   * Publish a message, which is latched. If the bridge refuses it, the event `refused` says why.
   * @param {string} topic
   * @param {string} type such as geometry_msgs/msg/PointStamped
   * @param {object} message without a stamp, the bridge sets the present time
   * @throws {Error} if there is no connection
   */
  publish(topic, type, message) {
    if (!this.#open) throw new Error("there is no connection to the run");
    if (!this.#advertised.has(topic)) {
      this.#advertised.set(topic, type);
      this.#announce(topic, type);
    }
    this.#send({ op: "publish", id: `publish-${topic}`, topic, msg: message });
  }

  /**
   * Call a service.
   * @param {string} service
   * @param {string} type such as std_srvs/srv/SetBool
   * @param {object} args
   * @returns {Promise<any>} the response
   * @throws {Error} if there is no connection, or the service fails
   */
  call(service, type, args) {
    if (!this.#open) return Promise.reject(new Error("there is no connection to the run"));
    const id = `call-${crypto.randomUUID?.() ?? Math.random()}`;
    return new Promise((resolve, reject) => {
      this.#calls.set(id, { resolve, reject });
      this.#send({ op: "call_service", id, service, type, args });
    });
  }

  close() {
    this.#socket.close();
  }

  #announce(topic, type) {
    this.#send({ op: "advertise", id: `publish-${topic}`, topic, type, latch: true, queue_size: 1 });
  }

  #ask(topic, type, period) {
    this.#send({ op: "subscribe", topic, type, throttle_rate: period, queue_length: 1 });
  }

  #send(message) {
    this.#socket.send(JSON.stringify(message));
  }

  #take(message, { refused }) {
    if (message.op === "status" && message.level === "error" && message.id?.startsWith("publish-")) refused?.(message.msg);
    const call = this.#calls.get(message.id);
    if (call && (message.op === "service_response" || message.level === "error")) {
      this.#calls.delete(message.id);
      if (message.result) call.resolve(message.values);
      else call.reject(new Error(message.msg ?? String(message.values)));
    }
    if (message.op === "publish") this.#topics.get(message.topic)?.hear(message.msg);
  }
}
