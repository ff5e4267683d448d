"""Topics that one client subscribes to, at the rate and in the form that it asks for, and that it publishes."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.belongings import Belongings
from throwcollect.serve.rosbridge.feed import Feed, Sample
from throwcollect.serve.rosbridge.guarded import open_topic
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import COMPRESSIONS, BridgeRequest, Form

_DEPTH = 100
_HEADER = "std_msgs/Header"


@dataclass(frozen=True)
class SubscriptionRequest:
    """What one subscription of a client asks for.

    Attributes:
        throttle_s: Least time between two messages [s].
        queue_length: Messages that may wait for their time; beyond that, the oldest are left out.
        form: How messages are sent.
    """

    throttle_s: float = 0.0
    queue_length: int = 0
    form: Form = field(default_factory=Form)


class RateLimit:
    """Lets samples through to `send` at the rate that a client asks for; `later` calls an action after a time [s]."""

    def __init__(self, send: Callable[[Sample], None], later: Callable[[float, Callable[[], None]], None]) -> None:
        self._send = send
        self._later = later
        self._queue: deque[Sample] = deque()
        self._request = SubscriptionRequest()
        self._due = 0.0
        self._waits = False

    def change(self, request: SubscriptionRequest) -> None:
        """Use another rate and form from now on."""
        self._request = request
        self._queue = deque(self._queue, maxlen=request.queue_length)
        # A shorter interval takes effect at once, and not only after the next sample.
        self._due = min(self._due, time.monotonic() + request.throttle_s)

    def offer(self, sample: Sample) -> None:
        """Send a sample, keep it until it is due, or leave it out."""
        now = time.monotonic()
        if now >= self._due and not self._queue:
            self._let_through(sample, now)
        elif self._request.queue_length:
            self._queue.append(sample)
            self._wait(now)

    def clear(self) -> None:
        """Forget the samples that wait; a timer that still runs then finds none."""
        self._queue.clear()

    def _let_through(self, sample: Sample, now: float) -> None:
        # Waiting samples are sent at even intervals, so the next interval begins when this sample was due, and not at
        # `now`, as the timer may be late.
        is_late = now - self._due < self._request.throttle_s and self._request.queue_length
        self._due = (self._due if is_late else now) + self._request.throttle_s
        self._send(sample)

    def _wait(self, now: float) -> None:
        if not self._waits:
            self._waits = True
            self._later(max(self._due - now, 0.0), self._continue)

    def _continue(self) -> None:
        self._waits = False
        if self._queue:
            now = time.monotonic()
            self._let_through(self._queue.popleft(), now)
            if self._queue:
                self._wait(now)


class SubscribedTopic:
    """A topic of a client, which may have several subscriptions to it under different ids."""

    def __init__(self, client: Peer, given: str, type_name: str) -> None:
        self._client = client
        self._given = given
        self._topic = open_topic(given)
        self.type_name = type_name
        self.requests: dict[object, SubscriptionRequest] = {}
        self._merged = SubscriptionRequest()
        self._feed: Feed | None = None
        self._pace = RateLimit(self._send, client.host.later)

    def want(self, name: object, request: SubscriptionRequest) -> None:
        """Add one subscription of the client, or change it."""
        self.requests[name] = request
        self._merge()

    def leave(self, name: object) -> None:
        """Remove one subscription of the client."""
        del self.requests[name]
        if self.requests:
            self._merge()

    def open(self) -> None:
        """Begin to listen, in the session of the bridge."""
        self._feed = self._client.host.session.listen(self._topic, self.type_name, self._pace.offer)

    def lose(self) -> None:
        """Forget the session, which has ended, and all messages that came by it."""
        self._feed = None
        self._pace.clear()

    def close(self) -> None:
        """Listen no more."""
        if self._feed is not None:
            self._feed.remove(self._pace.offer)
            self._feed = None
        # Nothing may come after the client has unsubscribed, also no message that waits for its time.
        self._pace.clear()

    def _merge(self) -> None:
        requests = self.requests.values()
        self._merged = SubscriptionRequest(
            min(request.throttle_s for request in requests),
            max(request.queue_length for request in requests),
            Form(
                max((request.form.compression for request in requests), key=COMPRESSIONS.index),
                min((request.form.fragment_size for request in requests if request.form.fragment_size), default=0),
            ),
        )
        self._pace.change(self._merged)

    def _send(self, sample: Sample) -> None:
        try:
            frame = sample.frame(self._given, self._merged.form.compression)
        except ValueError as error:
            self._client.say("error", f"{self._topic}: a message cannot be read: {error}")
            return
        self._client.send(frame, self._merged.form.fragment_size)


class Subscriptions(Belongings[SubscribedTopic]):
    """All topics that a client subscribes to."""

    def subscribe(self, request: BridgeRequest) -> None:
        """Subscribe to a topic."""
        given = request.text("topic")
        topic = open_topic(given)
        wanted = SubscriptionRequest(
            request.natural_or("throttle_rate", 0) / 1000,
            request.natural_or("queue_length", 0),
            request.form(),
        )
        type_name = self._client.host.session.type_of(topic, request.text_or("type", ""))
        subscription = self._by_name.get(given)
        if subscription is not None and subscription.type_name != type_name:
            raise ConfigError(
                f"subscribe: {given} is subscribed to as {subscription.type_name} already", expected="that type"
            )
        if subscription is None:
            subscription = SubscribedTopic(self._client, given, type_name)
            subscription.want(request.id, wanted)
            subscription.open()
            self._by_name[given] = subscription
        else:
            subscription.want(request.id, wanted)

    def unsubscribe(self, request: BridgeRequest) -> None:
        """End one subscription to a topic, or all if none is named."""
        given = request.text("topic")
        subscription = self._by_name.get(given)
        if subscription is None or (request.id is not None and request.id not in subscription.requests):
            which = "" if request.id is None else f" with the id {request.id}"
            raise ConfigError(f"unsubscribe: there is no subscription to {given}{which}")
        for name in list(subscription.requests) if request.id is None else [request.id]:
            subscription.leave(name)
        if not subscription.requests:
            subscription.close()
            del self._by_name[given]


@dataclass
class Advertised:
    """A topic that a client publishes.

    Attributes:
        client: The client.
        topic: Absolute name of the topic.
        type_name: Full name of its type.
        latched: Whether subscribers that join late get the last message.
        depth: Messages that are kept for slow subscribers.
        publisher: The publisher; None while there is no session.
    """

    client: Peer
    topic: str
    type_name: str
    latched: bool
    depth: int
    publisher: ros.Publisher | None = None

    def open(self) -> None:
        """Announce the topic."""
        qos = ros.QoSProfile(depth=1 if self.latched else self.depth)
        if self.latched:
            qos.durability = ros.DurabilityPolicy.TRANSIENT_LOCAL
        message_type = ros.get_message(self.type_name)
        self.publisher = self.client.host.session.node.create_publisher(message_type, self.topic, qos)

    def lose(self) -> None:
        """Forget the session, which has ended."""
        self.publisher = None

    def close(self) -> None:
        """Withdraw the topic."""
        if self.publisher is not None:
            self.client.host.session.node.destroy_publisher(self.publisher)


class Publishers(Belongings[Advertised]):
    """All topics that a client publishes."""

    def advertise(self, request: BridgeRequest) -> None:
        """Announce a topic."""
        self._advertise(open_topic(request.text("topic")), request, request.text("type"))

    def unadvertise(self, request: BridgeRequest) -> None:
        """Withdraw a topic."""
        topic = open_topic(request.text("topic"))
        advertised = self._by_name.pop(topic, None)
        if advertised is None:
            self._client.say("warning", f"unadvertise: {topic} is not advertised", request.id)
        else:
            advertised.close()

    def publish(self, request: BridgeRequest) -> None:
        """Publish a message; a topic that the client has not announced, but others have, is announced first."""
        topic = open_topic(request.text("topic"))
        advertised = self._by_name.get(topic) or self._advertise(topic, request, request.text_or("type", ""))
        message = ros.get_message(advertised.type_name)()
        values = request.any("msg")
        self._stamp(message, values)
        fill(message, {} if values is None else values)
        if advertised.publisher is not None:
            try:
                advertised.publisher.publish(message)
            except ValueError as error:
                raise ConfigError(f"publish: {error}") from error

    def _advertise(self, topic: str, request: BridgeRequest, wanted: str) -> Advertised:
        type_name = self._client.host.session.type_of(topic, wanted)
        known = self._by_name.get(topic)
        if known is not None:
            if known.type_name != type_name:
                raise ConfigError(f"{topic} is advertised as {known.type_name} already", expected="that type")
            return known
        depth = request.natural_or("queue_size", _DEPTH) or _DEPTH
        advertised = Advertised(self._client, topic, type_name, request.flag("latch"), depth)
        advertised.open()
        self._by_name[topic] = advertised
        return advertised

    def _stamp(self, message: Any, values: object) -> None:
        """Set the stamp of the header to the present time; `fill` replaces it if the client has one."""
        if message.get_fields_and_field_types().get("header") == _HEADER and isinstance(values, Mapping):
            message.header.stamp = self._client.host.session.node.get_clock().now().to_msg()
