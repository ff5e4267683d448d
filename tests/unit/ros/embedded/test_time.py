import pytest

from throwcollect.interfaces import get_message
from throwcollect.ros import ClockType, Duration, Time


def test_times_and_durations_calculate():
    time = Time(seconds=2, nanoseconds=5, clock_type=ClockType.ROS_TIME)
    assert time.seconds_nanoseconds() == (2, 5)
    assert (time + Duration(seconds=1.5)).nanoseconds == 3_500_000_005
    assert time - Time(seconds=3, clock_type=ClockType.ROS_TIME) == Duration(nanoseconds=-999_999_995)
    assert (time - Duration(seconds=1)).nanoseconds == 1_000_000_005
    assert Duration(seconds=1) < Duration(nanoseconds=1_000_000_001)


def test_times_of_different_clocks_do_not_compare():
    with pytest.raises(TypeError, match="different clocks"):
        _ = Time(seconds=1) < Time(seconds=1, clock_type=ClockType.ROS_TIME)


def test_times_are_not_negative_and_fit_64_bits():
    with pytest.raises(ValueError, match="must not be negative"):
        Time(nanoseconds=-1)
    with pytest.raises(OverflowError, match="64 bits"):
        Time(nanoseconds=2**63)
    with pytest.raises(OverflowError, match="64 bits"):
        Duration(nanoseconds=2**63)


def test_messages_are_exact():
    message = get_message("builtin_interfaces/msg/Time")(sec=2**31 - 1, nanosec=999_999_999)
    assert Time.from_msg(message).to_msg() == message
    assert Time.from_msg(message).clock_type is ClockType.ROS_TIME
    assert Duration(nanoseconds=-1).to_msg() == get_message("builtin_interfaces/msg/Duration")(
        sec=-1, nanosec=999_999_999
    )
    assert Duration.from_msg(Duration(nanoseconds=-1).to_msg()) == Duration(nanoseconds=-1)
