"""Topics that one client subscribes to, at the rate and in the form that it asks for, and that it publishes."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.bridge import Client, Sample
from throwcollect.serve.rosbridge.codec import cut
from throwcollect.serve.rosbridge.guarded import open_topic
from throwcollect.serve.rosbridge.operations import COMPRESSIONS, Publish, RequestId, Subscribe, Withdraw

_DEPTH = 100
_EARLY_S = 1e-4
_HEADER = "std_msgs/Header"


class RateLimit:
    """Lets samples through to `send` at intervals: of those that come meanwhile, the newest wait in a queue.

    `later` calls an action after a time [s].
    """

    def __init__(self, send: Callable[[Sample], None], later: Callable[[float, Callable[[], None]], None]) -> None:
        self._send = send
        self._later = later
        self._queue: deque[Sample] = deque(maxlen=0)
        self._interval_s = 0.0
        self._due = 0.0

    def change(self, interval_s: float, queue_length: int) -> None:
        """Use another interval and queue from now on; a shorter interval takes effect at once."""
        now = time.monotonic()
        self._queue = deque(self._queue, maxlen=queue_length)
        self._interval_s = interval_s
        self._due = min(self._due, now + interval_s)
        self._later(max(self._due - now, 0.0), self._continue)

    def offer(self, sample: Sample) -> None:
        """Send a sample, keep it until it is due, or leave it out."""
        now = time.monotonic()
        if not self._queue and now >= self._due:
            self._let_through(sample, now)
        elif self._queue.maxlen:
            if not self._queue:
                self._later(self._due - now, self._continue)
            self._queue.append(sample)

    def clear(self) -> None:
        """Forget the samples that wait; a timer that still runs then finds none."""
        self._queue.clear()

    def _let_through(self, sample: Sample, now: float) -> None:
        # Samples of a queue are sent at even intervals, so the next interval begins when this sample was due, and not
        # at `now`, as the timer may be late.
        is_late = now - self._due < self._interval_s and self._queue.maxlen
        self._due = (self._due if is_late else now) + self._interval_s
        self._send(sample)

    def _continue(self) -> None:
        now = time.monotonic()
        # A timer of an earlier interval may come too soon; the sample then has a later timer.
        if self._queue and now >= self._due - _EARLY_S:
            self._let_through(self._queue.popleft(), now)
            if self._queue:
                self._later(self._due - now, self._continue)


class SubscribedTopic:
    """A topic of a client, which may have several subscriptions to it under different ids."""

    def __init__(self, client: Client, asked: Subscribe, topic: str, type_name: str) -> None:
        self.type_name = type_name
        self._client = client
        self._given = asked.topic
        self._asked: dict[RequestId, Subscribe] = {}
        self._pace = RateLimit(self._send, client.bridge.later)
        self.add(asked)
        self._stop = client.bridge.listen(topic, type_name, self._pace.offer)

    def add(self, asked: Subscribe) -> None:
        """Add one subscription of the client, or change it."""
        self._asked[asked.id] = asked
        self._merge()

    def leave(self, asked: Withdraw) -> bool:
        """End one subscription of the client, or all if no id is given; returns whether none is left."""
        if asked.id is not None and asked.id not in self._asked:
            raise ConfigError(f"unsubscribe: there is no subscription to {self._given} with the id {asked.id}")
        self._asked = {each: other for each, other in self._asked.items() if asked.id not in (None, each)}
        if self._asked:
            self._merge()
        else:
            self.close()
        return not self._asked

    def close(self) -> None:
        """Listen no more."""
        self._stop()
        # Nothing may come after the client has unsubscribed, also no message that waits for its time.
        self._pace.clear()

    def _merge(self) -> None:
        asked = self._asked.values()
        self._compression = max((each.compression for each in asked), key=COMPRESSIONS.index)
        self._fragment_size = min((each.fragment_size for each in asked if each.fragment_size), default=0)
        self._pace.change(min(each.throttle_rate for each in asked) / 1000, max(each.queue_length for each in asked))

    def _send(self, sample: Sample) -> None:
        for part in cut(sample.frame(self._given, self._compression), self._fragment_size):
            self._client.send(part)


class Subscriptions:
    """All topics that a client subscribes to, by its names for them."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._topics: dict[str, SubscribedTopic] = {}

    def subscribe(self, asked: Subscribe) -> None:
        """Subscribe to a topic."""
        topic = open_topic(asked.topic)
        type_name = self._client.bridge.type_of(topic, asked.type)
        known = self._topics.get(asked.topic)
        if known is None:
            self._topics[asked.topic] = SubscribedTopic(self._client, asked, topic, type_name)
        elif known.type_name != type_name:
            raise ConfigError(f"subscribe: {topic} is subscribed to as {known.type_name}", expected="that type")
        else:
            known.add(asked)

    def unsubscribe(self, asked: Withdraw) -> None:
        """End one subscription to a topic, or all if none is named."""
        if asked.topic not in self._topics:
            raise ConfigError(f"unsubscribe: there is no subscription to {asked.topic}")
        if self._topics[asked.topic].leave(asked):
            del self._topics[asked.topic]

    def close(self) -> None:
        """End all subscriptions."""
        for topic in self._topics.values():
            topic.close()


class Publishers:
    """All topics that a client publishes, each with the name of its type and its publisher."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._publishers: dict[str, tuple[str, ros.Publisher]] = {}

    def advertise(self, asked: Publish) -> None:
        """Announce a topic."""
        topic = open_topic(asked.topic)
        type_name = self._client.bridge.type_of(topic, asked.type)
        if topic in self._publishers:
            if (known := self._publishers[topic][0]) != type_name:
                raise ConfigError(f"{topic} is advertised as {known} already", expected="that type")
            return
        qos = ros.QoSProfile(depth=1 if asked.latch else asked.queue_size or _DEPTH)
        if asked.latch:
            qos.durability = ros.DurabilityPolicy.TRANSIENT_LOCAL
        publisher = self._client.bridge.node.create_publisher(ros.get_message(type_name), topic, qos)
        self._publishers[topic] = type_name, publisher

    def unadvertise(self, asked: Withdraw) -> None:
        """Withdraw a topic."""
        topic = open_topic(asked.topic)
        if topic in self._publishers:
            _, publisher = self._publishers.pop(topic)
            self._client.bridge.node.destroy_publisher(publisher)
        else:
            self._client.report("warning", f"unadvertise: {topic} is not advertised", asked.id)

    def publish(self, asked: Publish) -> None:
        """Publish a message; a topic that the client has not announced, but others have, is announced first."""
        topic = open_topic(asked.topic)
        if topic not in self._publishers:
            self.advertise(asked)
        type_name, publisher = self._publishers[topic]
        message: Any = ros.get_message(type_name)()
        if message.get_fields_and_field_types().get("header") == _HEADER and isinstance(asked.msg, Mapping):
            # The stamp is the present time, unless the client has one.
            message.header.stamp = self._client.bridge.node.get_clock().now().to_msg()
        fill(message, {} if asked.msg is None else asked.msg)
        publisher.publish(message)

    def close(self) -> None:
        """Withdraw all topics."""
        for _, publisher in self._publishers.values():
            self._client.bridge.node.destroy_publisher(publisher)
