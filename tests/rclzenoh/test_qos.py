import pytest

from rclzenoh import qos
from rclzenoh.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
    decode,
    encode,
)
from rclzenoh.time import Duration, Infinite

_SYSTEM_DEFAULT = QoSProfile(
    depth=0,
    history=HistoryPolicy.SYSTEM_DEFAULT,
    reliability=ReliabilityPolicy.SYSTEM_DEFAULT,
    durability=DurabilityPolicy.SYSTEM_DEFAULT,
)


@pytest.mark.parametrize(
    ("profile", "text"),
    [
        (qos.qos_profile_services_default, "::,10:,:,:,,"),
        (QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT), "2::,5:,:,:,,"),
        (_SYSTEM_DEFAULT, "::,:,:,:,,"),
        (qos.qos_profile_action_status_default, ":1:,1:,:,:,,"),
        (qos.qos_profile_rosout, ":1:,1000:,:10,0:,,"),
        (qos.qos_profile_parameters, "::,1000:,:,:,,"),
        (QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT), "2::,1:,:,:,,"),
        (QoSProfile(depth=0, history=HistoryPolicy.KEEP_ALL), "::2,:,:,:,,"),
        (QoSProfile(depth=42), "::,:,:,:,,"),
        (QoSProfile(depth=1, deadline=Infinite, lifespan=Infinite), "::,1:,:,:,,"),
        (QoSProfile(depth=1, deadline=Duration(nanoseconds=1_500_000_000)), "::,1:1,500000000:,:,,"),
        (
            QoSProfile(
                depth=1,
                durability=DurabilityPolicy.BEST_AVAILABLE,
                liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
                liveliness_lease_duration=Duration(nanoseconds=2_000_000_000),
            ),
            ":4:,1:,:,:3,2,0",
        ),
    ],
)
def test_profiles_are_written_as_rmw_zenoh_does(profile, text):
    assert encode(profile) == text
    assert encode(decode(text)) == text


def test_a_profile_is_read_with_the_defaults_of_the_middleware():
    profile = decode(":1:,:,:10,0:3,2,5")
    assert (profile.reliability, profile.durability) == (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)
    assert (profile.history, profile.depth) == (HistoryPolicy.KEEP_LAST, 42)
    assert (profile.deadline, profile.lifespan) == (Infinite, Duration(nanoseconds=10_000_000_000))
    assert profile.liveliness is LivelinessPolicy.MANUAL_BY_TOPIC
    assert profile.liveliness_lease_duration == Duration(nanoseconds=2_000_000_005)


def test_history_or_depth_is_required():
    with pytest.raises(ValueError, match="history and/or depth"):
        QoSProfile()
    with pytest.raises(ValueError, match="KEEP_LAST needs a depth"):
        QoSProfile(history=HistoryPolicy.KEEP_LAST)


@pytest.mark.parametrize(
    ("profile", "length"),
    [
        (QoSProfile(depth=3), 3),
        (_SYSTEM_DEFAULT, 42),
        (QoSProfile(history=HistoryPolicy.KEEP_ALL), None),
    ],
)
def test_receivers_keep_as_many_messages_as_the_profile_says(profile, length):
    assert profile.queue_length == length
