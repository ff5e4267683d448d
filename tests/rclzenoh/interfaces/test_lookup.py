from rclzenoh.interfaces import get_action, get_service


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
