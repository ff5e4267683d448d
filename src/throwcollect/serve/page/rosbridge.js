/** A small client of rosbridge v2: topics that are heard and published, services that are called. */

const PERIOD_MS = 33;

/** A connection to the ROS graph of one run. */
export class Rosbridge {
  #socket;
  #topics = new Map();
  #advertised = new Map();
  #calls = new Map();
  #count = 0;
  #open = false;

  /**
   * @param {import("./connection.js").Connection} connection
   * @param {string} run id of the run
   * @param {object} events
   * @param {() => void} [events.opened]
   * @param {() => void} [events.lost]
   * @param {(text: string) => void} [events.refused] is told why something was not published
   */
  constructor(connection, run, events = {}) {
    this.#socket = connection.openRosbridge(run, {
      opened: () => {
        this.#open = true;
        for (const [topic, { type }] of this.#topics) this.#ask(topic, type);
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
   * Hear a topic, also after the connection was lost; at most 30 messages a second.
   * @param {string} topic
   * @param {string} type such as std_msgs/msg/String
   * @param {(message: any) => void} hear
   */
  subscribe(topic, type, hear) {
    this.#topics.set(topic, { type, hear });
    if (this.#open) this.#ask(topic, type);
  }

  /** @param {string} topic is not heard any more */
  unsubscribe(topic) {
    if (this.#topics.delete(topic)) this.#send({ op: "unsubscribe", topic });
  }

  /**
   * @param {string} service
   * @param {string} type
   * @param {object} args the request
   * @returns {Promise<any>} the response
   * @throws {Error} if it cannot be had
   */
  call(service, type, args) {
    if (!this.#open) return Promise.reject(new Error("there is no connection to the run"));
    const id = `call-${(this.#count += 1)}`;
    const answer = new Promise((resolve, reject) => this.#calls.set(id, { resolve, reject }));
    this.#send({ op: "call_service", id, service, type, args });
    return answer;
  }

  /**
   * Publish a message; whoever joins late hears the last one. What the bridge refuses is told as an event.
   * @param {string} topic
   * @param {string} type such as geometry_msgs/msg/PointStamped
   * @param {object} message a stamp that it lacks is the present time
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

  close() {
    this.#socket.close();
  }

  #announce(topic, type) {
    this.#send({ op: "advertise", id: `publish-${topic}`, topic, type, latch: true, queue_size: 1 });
  }

  #ask(topic, type) {
    this.#send({ op: "subscribe", topic, type, throttle_rate: PERIOD_MS, queue_length: 1 });
  }

  #send(message) {
    this.#socket.send(JSON.stringify(message));
  }

  #take(message, { refused }) {
    if (message.op === "status" && message.level === "error" && message.id?.startsWith("publish-")) refused?.(message.msg);
    if (message.op === "publish") this.#topics.get(message.topic)?.hear(message.msg);
    if (message.op !== "service_response") return;
    const call = this.#calls.get(message.id);
    this.#calls.delete(message.id);
    if (message.result) call?.resolve(message.values);
    else call?.reject(new Error(typeof message.values === "string" ? message.values : "the service failed"));
  }
}
