from throwcollect.ros import Time, get_message


def test_a_time_survives_the_way_through_a_message_exactly():
    message = get_message("builtin_interfaces/msg/Time")(sec=2**31 - 1, nanosec=999_999_999)
    assert Time.from_msg(message).to_msg() == message
    assert Time(nanoseconds=5).to_msg() == get_message("builtin_interfaces/msg/Time")(nanosec=5)
