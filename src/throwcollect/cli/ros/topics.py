"""`throwcollect ros topic`: who publishes and subscribes to what, and what is said."""

from __future__ import annotations

import statistics
import time
from collections import deque
from itertools import pairwise
from typing import Any

from throwcollect.cli.ros.session import Session, absolute, full_name, interface, is_hidden, joined, known, print_names
from throwcollect.cli.ros.values import SHORT, plain, yaml_text
from throwcollect.errors import ConfigError
from throwcollect.ros import DurabilityPolicy, QoSProfile, ReliabilityPolicy, get_message

_DEPTH = 100
_REPORT_NS = 10**9
_SENSOR_DATA = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)


def show_topics(run: str | None, *, types: bool, hidden: bool) -> None:
    """Print the names of all topics."""
    with joined(run) as session:
        print_names(sorted(session.node.get_topic_names_and_types()), types=types, hidden=hidden)


def show_topic(run: str | None, topic: str, *, verbose: bool) -> None:
    """Print the type of a topic and its endpoints.

    Raises:
        ConfigError: If there is no such topic.
    """
    with joined(run) as session:
        name, kinds = _types(session, topic)
        known("topic", name, _names(session))
        end = "\n\n" if verbose else "\n"
        print(f"Type: {kinds[0] if len(kinds) == 1 else kinds}", end=end)
        node = session.node
        for what, infos in (
            ("Publisher", node.get_publishers_info_by_topic(name)),
            ("Subscription", node.get_subscriptions_info_by_topic(name)),
        ):
            print(f"{what} count: {len(infos)}", end=end)
            if verbose:
                for info in infos:
                    print(info, end=end)


def echo(run: str | None, topic: str, kind: str | None, *, once: bool, field: str | None, full: bool) -> None:
    """Print the messages of a topic until the user leaves.

    Raises:
        ConfigError: If there is no such topic, type or field.
        Interrupted: If the user leaves.
    """
    with joined(run) as session:
        name, message_type = _message_type(session, topic, kind)
        path = field.split(".") if field else []
        _check_field(message_type, path)
        heard = False

        def show(message: Any) -> None:
            nonlocal heard
            if once and heard:
                return
            heard = True
            for part in path:
                message = getattr(message, part)
            print(yaml_text(plain(message, None if full else SHORT)), end="---\n", flush=True)

        session.node.create_subscription(message_type, name, show, _offered_qos(session, name))
        session.spin_until(lambda: once and heard)


def show_rate(run: str | None, topic: str, *, window: int) -> None:
    """Print every second how often messages have arrived, until the user leaves.

    Raises:
        ConfigError: If there is no such topic.
        Interrupted: If the user leaves.
    """
    with joined(run) as session:
        name, message_type = _message_type(session, topic, None)
        arrivals: deque[int] = deque(maxlen=window + 1)
        session.node.create_subscription(
            message_type, name, lambda _: arrivals.append(time.monotonic_ns()), _SENSOR_DATA, raw=True
        )
        told = time.monotonic_ns()
        while True:
            report = told + _REPORT_NS
            session.spin_until(lambda until=report: time.monotonic_ns() >= until)  # type: ignore[misc]
            if len(arrivals) > 1 and arrivals[-1] > told:
                print(_rate(arrivals), flush=True)
            told = report


def _rate(arrivals: deque[int]) -> str:
    gaps = [(after - before) * 1e-9 for before, after in pairwise(arrivals)]
    mean = statistics.fmean(gaps)
    rate = 1.0 / mean if mean else 0.0
    return (
        f"average rate: {rate:.3f}\n\tmin: {min(gaps):.3f}s max: {max(gaps):.3f}s "
        f"std dev: {statistics.pstdev(gaps):.5f}s window: {len(gaps)}"
    )


def _names(session: Session) -> list[str]:
    return [name for name, _ in session.node.get_topic_names_and_types()]


def _types(session: Session, topic: str) -> tuple[str, list[str]]:
    name = absolute(topic)
    return name, dict(session.node.get_topic_names_and_types()).get(name, [])


def _message_type(session: Session, topic: str, kind: str | None) -> tuple[str, Any]:
    """Absolute name and class of a topic."""
    name, kinds = _types(session, topic)
    if kind is None:
        known("topic", name, (each for each in _names(session) if not is_hidden(each) or each == name))
        if len(kinds) > 1:
            raise ConfigError(f"{name} has {len(kinds)} types", expected=f"one of {', '.join(kinds)}")
        (kind,) = kinds
    message_type = interface("msg", get_message, kind)
    if kinds and (full := full_name("msg", kind)) not in kinds:
        raise ConfigError(f"{name} is no {full}", expected=", ".join(kinds))
    return name, message_type


def _check_field(message_type: Any, path: list[str]) -> None:
    value = message_type()
    for part in path:
        fields = value.get_fields_and_field_types() if hasattr(value, "get_fields_and_field_types") else {}
        if part not in fields:
            raise ConfigError(
                f"--field {'.'.join(path)}: no field {part!r}",
                expected=f"one of {', '.join(fields)}" if fields else f"nothing below {type(value).__name__}",
            )
        value = getattr(value, part)


def _offered_qos(session: Session, name: str) -> QoSProfile:
    """What all publishers of a topic offer."""
    offered = [info.qos_profile for info in session.node.get_publishers_info_by_topic(name)]
    profile = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
    if offered and all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered):
        profile.reliability = ReliabilityPolicy.RELIABLE
    if offered and all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered):
        profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    return profile
