from throwcollect.ros import Time, get_message


def test_messages_are_exact():
    message = get_message("builtin_interfaces/msg/Time")(sec=2**31 - 1, nanosec=999_999_999)
    assert Time.from_msg(message).to_msg() == message
    assert Time(nanoseconds=5).to_msg() == get_message("builtin_interfaces/msg/Time")(nanosec=5)
