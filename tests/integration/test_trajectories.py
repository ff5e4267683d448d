"""Joint trajectories, by action and by topic."""

import math
import uuid
from typing import Any

import pytest

from tests.integration.robot import (
    ARM,
    ELBOW,
    PAUSED,
    PLAYING,
    POSTURE,
    SAMPLE_NS,
    STEP_NS,
    TORSO,
    FollowJointTrajectory,
    JointTolerance,
    JointTrajectory,
    Robot,
    goal,
    stamp_ns,
    swing,
    trajectory,
)
from throwcollect.robots.talos import TALOS
from throwcollect.ros import get_message, get_service

SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
REACHED = (SUCCEEDED, 0, "Goal successfully reached!")
PREEMPTED = (ABORTED, -1, "Current goal preempted by new incoming action.")
UUID: Any = get_message("unique_identifier_msgs/msg/UUID")
GoalInfo: Any = get_message("action_msgs/msg/GoalInfo")
CancelGoal: Any = get_service("action_msgs/srv/CancelGoal").Response


def change_trajectory(wish: Any, **fields: Any) -> Any:
    for name, value in fields.items():
        setattr(wish.trajectory, name, value)
    return wish


def test_a_goal_succeeds_with_the_joint_at_its_position(robot: Robot) -> None:
    handle = robot.send(goal(ARM, 1.0, arm_right_4_joint=-0.9))
    assert handle.accepted
    assert robot.outcome(handle) == REACHED
    assert robot.joint(ELBOW) == pytest.approx(-0.9, abs=0.005)


def test_the_goals_of_all_eight_limbs_are_carried_out_at_once(robot: Robot) -> None:
    robot.put_into(PAUSED)
    handles = [robot.send(goal(controller, 0.5), controller) for controller in TALOS.controllers]
    robot.put_into(PLAYING)
    assert [robot.outcome(handle) for handle in handles] == [REACHED] * 8


@pytest.mark.parametrize(("seconds", "factor"), [(0.52, 0.0), (1.0, 0.0), (0.52, 2.0)])
def test_feedback_comes_at_20_hz_of_simulated_time_from_the_start_on(
    seconds: float, factor: float, robot: Robot
) -> None:
    assert robot.set({"sim.real_time_factor": factor}).successful
    topic = f"{ARM}/follow_joint_trajectory/_action/feedback"
    with robot.listening(FollowJointTrajectory.Impl.FeedbackMessage, topic) as heard:
        handle = robot.send(goal(ARM, seconds, arm_right_4_joint=-1.7))
        assert robot.outcome(handle) == REACHED
        # On DDS, the result takes another way, and may overtake the last feedback.
        robot.wait_until(lambda: len(heard) >= math.ceil(seconds / 0.05) - 1, "the last feedback")
        assert {bytes(message.goal_id.uuid) for message in heard} == {bytes(handle.goal_id.uuid)}
    stamps = [stamp_ns(message.feedback.header.stamp) for message in heard]
    due = [50_000_000 * number for number in range(1, math.ceil(seconds / 0.05))]
    slack = 2 * SAMPLE_NS if factor else 0
    assert [stamp - time for stamp, time in zip(stamps, due, strict=True)] == pytest.approx([0] * len(due), abs=slack)
    middle = heard[len(heard) // 2].feedback
    assert tuple(middle.joint_names) == TALOS.controllers[ARM]
    column = TALOS.controllers[ARM].index(ELBOW)
    assert middle.desired.positions[column] - middle.actual.positions[column] == middle.error.positions[column]
    assert POSTURE[ELBOW] < middle.actual.positions[column] < -1.7
    elapsed = [stamp_ns(message.feedback.desired.time_from_start) for message in heard]
    assert elapsed == sorted(elapsed)


def test_feedback_is_sent_only_when_time_goes_on(robot: Robot) -> None:
    robot.put_into(PAUSED)
    topic = f"{ARM}/follow_joint_trajectory/_action/feedback"
    with robot.listening(FollowJointTrajectory.Impl.FeedbackMessage, topic) as heard:
        robot.send(swing())
        for steps in (10, 20):
            robot.step(steps)
            for _ in range(3):
                robot.state()
    assert [stamp_ns(message.feedback.header.stamp) for message in heard] == [10 * STEP_NS, 30 * STEP_NS]


@pytest.mark.parametrize(
    ("wish", "reason"),
    [
        (
            change_trajectory(goal(ARM), joint_names=list(TALOS.controllers["arm_left_controller"])),
            "Incoming joint arm_left_1_joint",
        ),
        (goal(ARM, arm_right_4_joint=float("nan")), f"Position of joint {ELBOW} at point #1 is not finite"),
    ],
)
def test_an_impossible_goal_is_rejected_and_the_log_says_why(wish: Any, reason: str, robot: Robot) -> None:
    with robot.listening("rcl_interfaces/msg/Log", "/rosout") as log:
        assert not robot.send(wish).accepted
        robot.wait_until(lambda: any(reason in message.msg for message in log), f"{reason!r} in {log}")
    assert robot.now_ns() == 0


def test_an_arm_that_cannot_follow_breaks_the_tolerance_of_the_path(robot: Robot) -> None:
    assert robot.set({"robot.effort_scale": 0.01}).successful
    robot.reset()
    wish = swing()
    wish.path_tolerance = [JointTolerance(name=ELBOW, position=0.1)]
    status, code, text = robot.outcome(robot.send(wish))
    assert (status, code) == (ABORTED, FollowJointTrajectory.Result.PATH_TOLERANCE_VIOLATED)
    assert code == -4
    assert text.startswith(f"Aborted due to path tolerance violation: joint {ELBOW} has position error 0.1")
    assert text.endswith("tolerance 0.1 rad")


def test_a_cancelled_goal_ends_as_cancelled_and_the_arm_stops_where_it_is(robot: Robot) -> None:
    robot.put_into(PAUSED)
    handle = robot.send(swing())
    robot.step(250)
    response = robot.result(handle.cancel_goal_async())
    assert response.return_code == CancelGoal.ERROR_NONE
    assert [bytes(info.goal_id.uuid) for info in response.goals_canceling] == [bytes(handle.goal_id.uuid)]
    assert robot.outcome(handle) == (CANCELED, 0, "")
    stopped = robot.joint(ELBOW)
    assert stopped == pytest.approx(-1.2, abs=0.05)
    robot.step(500)
    assert robot.joint(ELBOW) == pytest.approx(stopped, abs=0.005)


def test_a_goal_is_cancelled_while_the_clock_runs(robot: Robot) -> None:
    assert robot.set({"sim.real_time_factor": 1.0}).successful
    handle = robot.send(swing(8.0))
    before = robot.now_ns()
    robot.wait_until(lambda: robot.now_ns() > before, "time goes on")
    robot.result(handle.cancel_goal_async())
    assert robot.outcome(handle) == (CANCELED, 0, "")
    assert robot.joint(ELBOW) < -1.0


def test_goals_that_are_over_or_unknown_are_not_cancelled(robot: Robot) -> None:
    handle = robot.send(goal(ARM, 0.2))
    robot.outcome(handle)
    assert robot.result(handle.cancel_goal_async()).return_code == CancelGoal.ERROR_GOAL_TERMINATED
    request = GoalInfo(goal_id=UUID(uuid=list(uuid.uuid4().bytes)))
    service = f"{ARM}/follow_joint_trajectory/_action/cancel_goal"
    answer = robot.result(robot.ask("action_msgs/srv/CancelGoal", service, goal_info=request))
    assert answer.return_code == CancelGoal.ERROR_UNKNOWN_GOAL_ID


def test_the_last_of_several_goals_wins_and_each_gets_its_own_result(robot: Robot) -> None:
    # While the clock stands still, no goal is reached before the next one comes.
    robot.put_into(PAUSED)
    futures = [robot.action().send_goal_async(goal(ARM, 0.5, arm_right_4_joint=end)) for end in (-0.6, -1.0, -1.4)]
    handles = [robot.result(future) for future in futures]
    robot.put_into(PLAYING)
    assert [robot.outcome(handle) for handle in handles] == [PREEMPTED, PREEMPTED, REACHED]
    assert robot.joint(ELBOW) == pytest.approx(-1.4, abs=0.005)


def test_a_goal_of_another_limb_aborts_no_goal(robot: Robot) -> None:
    robot.put_into(PAUSED)
    handles = [robot.send(swing()), robot.send(goal(TORSO, 0.5), TORSO)]
    robot.put_into(PLAYING)
    assert [robot.outcome(handle) for handle in handles] == [REACHED, REACHED]


def test_a_reset_right_after_a_goal_aborts_it(robot: Robot) -> None:
    # At full speed, the swing could be over before a busy machine sends the second request.
    assert robot.set({"sim.real_time_factor": 1.0}).successful
    future = robot.action().send_goal_async(swing())
    reset = robot.ask("simulation_interfaces/srv/ResetSimulation", "reset_simulation")
    handle = robot.result(future)
    robot.result(reset)
    assert robot.outcome(handle) == (ABORTED, -1, "simulation was reset")
    assert robot.now_ns() == 0


def test_the_trajectory_topic_moves_the_arm(robot: Robot) -> None:
    publisher = robot.node.create_publisher(JointTrajectory, robot.topic(f"{ARM}/joint_trajectory"), 10)
    robot.wait_until(lambda: publisher.get_subscription_count() == 1, "the controller listens")
    publisher.publish(trajectory(ARM, 0.5, arm_right_4_joint=-0.7))
    robot.wait_until(lambda: robot.now_ns() >= 500_000_000, "the motion is over")
    assert robot.joint(ELBOW) == pytest.approx(-0.7, abs=0.005)
    robot.node.destroy_publisher(publisher)
