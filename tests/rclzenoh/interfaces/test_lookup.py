import pytest

from rclzenoh.interfaces import get_action, get_message, get_service


def test_a_service_holds_request_and_response():
    service = get_service("std_srvs/srv/SetBool")
    assert service.Request(data=True).data is True
    assert service.Response(success=True, message="x").message == "x"
    assert get_service("std_srvs/srv/SetBool") is service


def test_an_action_holds_its_parts_and_its_protocol():
    action = get_action("control_msgs/action/FollowJointTrajectory")
    assert action.Result.PATH_TOLERANCE_VIOLATED == -4
    request = action.Impl.SendGoalService.Request(goal=action.Goal())
    assert request.goal.trajectory.points == []
    assert isinstance(action.Impl.FeedbackMessage().feedback, action.Feedback)


@pytest.mark.parametrize("get", [get_message, get_service, get_action])
def test_a_name_of_another_kind_is_refused(get):
    name = "std_msgs/msg/String" if get is not get_message else "std_srvs/srv/Empty"
    with pytest.raises(ValueError, match="expected a name of the form"):
        get(name)
