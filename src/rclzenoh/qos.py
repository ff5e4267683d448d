"""Quality of service: policies, stock profiles, and how rmw_zenoh_cpp writes them into liveliness tokens."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

from rclzenoh.time import S_TO_NS, Duration, Infinite


class HistoryPolicy(IntEnum):
    """How many messages are kept."""

    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2
    UNKNOWN = 3


class ReliabilityPolicy(IntEnum):
    """Whether messages may be lost."""

    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class DurabilityPolicy(IntEnum):
    """Whether subscriptions that join late get earlier messages."""

    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class LivelinessPolicy(IntEnum):
    """How a publisher shows that it is alive."""

    SYSTEM_DEFAULT = 0
    AUTOMATIC = 1
    MANUAL_BY_TOPIC = 3
    UNKNOWN = 4
    BEST_AVAILABLE = 5


@dataclass(kw_only=True)
class QoSProfile:
    """Policies of one endpoint.

    Attributes:
        depth: Messages kept with `HistoryPolicy.KEEP_LAST`; 0 leaves it to the middleware, which keeps 42.
        history: How many messages are kept.
        reliability: Whether messages may be lost.
        durability: Whether subscriptions that join late get earlier messages.
        lifespan: Age at which a message expires; announced only.
        deadline: Longest time between two messages; announced only.
        liveliness: How a publisher shows that it is alive; announced only.
        liveliness_lease_duration: Time within which it must do so; announced only.
    """

    depth: int | None = None
    history: HistoryPolicy | None = None
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE
    lifespan: Duration = field(default_factory=Duration)
    deadline: Duration = field(default_factory=Duration)
    liveliness: LivelinessPolicy = LivelinessPolicy.SYSTEM_DEFAULT
    liveliness_lease_duration: Duration = field(default_factory=Duration)

    def __post_init__(self) -> None:
        if self.history is None and self.depth is None:
            raise ValueError("QoSProfile: history and/or depth are required")
        if self.history is None:
            self.history = HistoryPolicy.KEEP_LAST
        if self.depth is None:
            if self.history is HistoryPolicy.KEEP_LAST:
                raise ValueError("QoSProfile: KEEP_LAST needs a depth")
            self.depth = _RCL_DEPTH

    @property
    def queue_length(self) -> int | None:
        """Messages that a receiver keeps; None for all."""
        return None if self.history is HistoryPolicy.KEEP_ALL else self.depth or _MIDDLEWARE_DEPTH

    @property
    def is_reliable(self) -> bool:
        """Whether messages must not be lost."""
        return self.reliability is not ReliabilityPolicy.BEST_EFFORT

    @property
    def is_transient_local(self) -> bool:
        """Whether subscriptions that join late get earlier messages."""
        return self.durability is DurabilityPolicy.TRANSIENT_LOCAL


# The first is the depth of rmw's default profile, the second is what rmw_zenoh_cpp uses for profiles without a depth.
_RCL_DEPTH, _MIDDLEWARE_DEPTH = 10, 42


def encode(profile: QoSProfile) -> str:
    """Profile as the last chunk of a liveliness token; values that are the middleware's defaults are left empty.

    It reads ``reliability:durability:history,depth:deadline:lifespan:liveliness,lease``.
    """
    reliability = _write_number(profile.reliability, ReliabilityPolicy.RELIABLE)
    durability = _write_number(profile.durability, DurabilityPolicy.VOLATILE)
    history = _write_number(profile.history or HistoryPolicy.KEEP_LAST, HistoryPolicy.KEEP_LAST)
    depth = "" if profile.depth in (0, _MIDDLEWARE_DEPTH) else str(profile.depth)
    liveliness = _write_number(profile.liveliness, LivelinessPolicy.AUTOMATIC)
    deadline, lifespan, lease = map(
        _write_seconds, (profile.deadline, profile.lifespan, profile.liveliness_lease_duration)
    )
    return f"{reliability}:{durability}:{history},{depth}:{deadline}:{lifespan}:{liveliness},{lease}"


def decode(text: str) -> QoSProfile:
    """Profile from the last chunk of a liveliness token, with the middleware's defaults.

    Raises:
        ValueError: If the chunk is malformed.
    """
    groups = [group.split(",") for group in text.split(":")]
    (reliability, *_), (durability, *_), (history, depth, *_), deadline, lifespan, (liveliness, *lease), *_ = groups
    return QoSProfile(
        depth=int(depth or _MIDDLEWARE_DEPTH),
        history=HistoryPolicy(int(history or 1)),
        reliability=ReliabilityPolicy(int(reliability or 1)),
        durability=DurabilityPolicy(int(durability or 2)),
        lifespan=_read_duration(lifespan),
        deadline=_read_duration(deadline),
        liveliness=LivelinessPolicy(int(liveliness or 1)),
        liveliness_lease_duration=_read_duration(lease),
    )


def _read_duration(chunk: list[str]) -> Duration:
    seconds, nanoseconds, *_ = chunk
    if not seconds and not nanoseconds:
        return Infinite
    total = int(seconds or 0) * S_TO_NS + int(nanoseconds or 0)
    return Duration(nanoseconds=min(total, Infinite.nanoseconds))


def _write_number(policy: IntEnum, default: IntEnum) -> str:
    return "" if policy in (0, default) else str(int(policy))


def _write_seconds(duration: Duration) -> str:
    if duration.nanoseconds == 0 or duration == Infinite:
        return ","
    return ",".join(map(str, divmod(duration.nanoseconds, S_TO_NS)))


qos_profile_services_default = QoSProfile(depth=10)
qos_profile_parameters = qos_profile_parameter_events = QoSProfile(depth=1000)
qos_profile_action_status_default = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_ROSOUT_LIFESPAN = Duration(nanoseconds=10 * S_TO_NS)
qos_profile_rosout = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL, lifespan=_ROSOUT_LIFESPAN)
