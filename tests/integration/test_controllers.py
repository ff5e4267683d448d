"""Controllers as nodes of their own: their list, parameters, services and speed, and their configurable behaviour."""

import re
from collections.abc import Iterator
from typing import Any

import pytest

from rclzenoh.parameter import parameter_value_to_python
from tests.integration.robot import (
    ARM,
    CONFIG,
    ELBOW,
    PAUSED,
    POSTURE,
    STEP_NS,
    Robot,
    goal,
    running_simulation,
    stamp_ns,
    swing,
)
from throwcollect.config.controllers import ControllersConfig
from throwcollect.robots.talos import TALOS
from throwcollect.ros import Context, DurabilityPolicy, Parameter, QoSProfile, get_message

SUCCEEDED, ABORTED = 4, 6
STATE = "control_msgs/msg/JointTrajectoryControllerState"
JTC = "joint_trajectory_controller/JointTrajectoryController"
SpeedScalingFactor: Any = get_message("control_msgs/msg/SpeedScalingFactor")
Time: Any = get_message("builtin_interfaces/msg/Time")


def ask(robot: Robot, service: str, controller: str = ARM, **fields: Any) -> Any:
    kind = "".join(word.capitalize() for word in service.split("_"))
    return robot.result(robot.ask(f"rcl_interfaces/srv/{kind}", f"{controller}/{service}", **fields))


def values(robot: Robot, controller: str = ARM) -> dict[str, Any]:
    names = ask(robot, "list_parameters", controller).result.names
    found = ask(robot, "get_parameters", controller, names=names).values
    return {name: parameter_value_to_python(value) for name, value in zip(names, found, strict=True)}


def put(robot: Robot, **parameters: Any) -> Any:
    """Set parameters of the right arm's controller; two underscores stand for a dot."""
    messages = [
        Parameter(name.replace("__", "."), value=value).to_parameter_msg() for name, value in parameters.items()
    ]
    return ask(robot, "set_parameters_atomically", parameters=messages).result


def test_controllers_are_listed_as_the_controller_manager_does(robot: Robot) -> None:
    service = "controller_manager/list_controllers"
    listed = robot.result(robot.ask("controller_manager_msgs/srv/ListControllers", service)).controller
    assert [each.name for each in listed] == list(TALOS.controllers)
    assert {(each.state, each.type, each.update_rate) for each in listed} == {("active", JTC, CONFIG.sim.physics_hz)}
    for each in listed:
        positions = [f"{joint}/position" for joint in TALOS.controllers[each.name]]
        assert each.claimed_interfaces == each.required_command_interfaces == positions
        assert each.required_state_interfaces == positions
        assert (each.is_async, each.is_chainable, each.is_chained) == (False, False, False)
    # Some clients stop a motion when this answer changes.
    assert robot.result(robot.ask("controller_manager_msgs/srv/ListControllers", service)).controller == listed


def test_parameters_have_the_values_of_the_real_robot(robot: Robot) -> None:
    for controller, joints in TALOS.controllers.items():
        found = values(robot, controller)
        assert found["joints"] == found["command_joints"] == list(joints)
        assert (found["command_interfaces"], found["state_interfaces"]) == (["position"], ["position"])
        assert (found["constraints.goal_time"], found["constraints.stopped_velocity_tolerance"]) == (0.6, 0.05)
        for joint in joints:
            keys = ("trajectory", "goal", "max_deceleration_on_cancel")
            assert [found[f"constraints.{joint}.{key}"] for key in keys] == [0.0, 0.02, 0.0]
        assert found["interpolation_method"] == "splines"
        assert (found["action_monitor_rate"], found["cmd_timeout"]) == (20.0, 0.0)
        assert found["speed_scaling.initial_scaling_factor"] == 1.0
        assert found["set_last_command_interface_value_as_state_on_activation"] is True
        off = ["allow_partial_joints_goal", "allow_integration_in_goal_trajectories", "open_loop_control"]
        off += ["allow_nonzero_velocity_at_trajectory_end", "interpolate_from_desired_state"]
        assert not any(found[name] for name in (*off, "constraints.decelerate_on_cancel"))


@pytest.mark.parametrize(
    ("parameter", "value", "reason"),
    [
        ("constraints__goal_time", -1.0, r"constraints\.goal_time out of range"),
        ("interpolation_method", "none", "read-only"),
    ],
)
def test_impossible_parameters_are_refused_with_the_reason(
    parameter: str, value: Any, reason: str, robot: Robot
) -> None:
    before = values(robot)
    result = put(robot, **{parameter: value})
    assert not result.successful
    assert re.search(reason, result.reason)
    assert values(robot) == before


def test_query_state_returns_the_state_of_the_running_trajectory(robot: Robot) -> None:
    def query(time_ns: int) -> Any:
        time = Time(sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        return robot.result(robot.ask("control_msgs/srv/QueryTrajectoryState", f"{ARM}/query_state", time=time))

    assert not query(0).success
    robot.put_into(PAUSED)
    robot.send(goal(ARM, 1.0, arm_right_4_joint=-1.1))
    robot.step(10)
    middle, end = query(500_000_000), query(1_000_000_000)
    assert (middle.success, end.success, middle.message) == (True, False, "")
    assert tuple(middle.name) == TALOS.controllers[ARM]
    column = TALOS.controllers[ARM].index(ELBOW)
    assert middle.position[column] == pytest.approx((POSTURE[ELBOW] - 1.1) / 2)
    assert end.position[column] == pytest.approx(-1.1)
    assert middle.velocity[column] == pytest.approx((-1.1 - POSTURE[ELBOW]) * 1.875)
    assert len(middle.acceleration) == len(middle.name)


def test_the_speed_of_a_trajectory_can_be_scaled_until_a_reset(robot: Robot) -> None:
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    topic = robot.topic(f"{ARM}/speed_scaling_input")
    publisher = robot.node.create_publisher(SpeedScalingFactor, topic, latched)
    robot.wait_until(lambda: publisher.get_subscription_count() == 1, "the controller listens")
    robot.put_into(PAUSED)
    with robot.listening(STATE, f"{ARM}/controller_state") as heard:
        publisher.publish(SpeedScalingFactor(factor=0.25))
        robot.wait_until(lambda: bool(heard) and heard[-1].speed_scaling_factor == 0.25, "the speed")
        robot.send(swing())
        robot.step(100)
        robot.wait_until(lambda: stamp_ns(heard[-1].header.stamp) == 99 * STEP_NS, "the last state")
        assert stamp_ns(heard[-1].feedback.time_from_start) == 99 * STEP_NS
        assert stamp_ns(heard[-1].reference.time_from_start) == 99 * STEP_NS // 4
        robot.reset()
        robot.wait_until(lambda: heard[-1].speed_scaling_factor == 1.0, "the speed at the start")
    robot.node.destroy_publisher(publisher)


def test_steps_advance_a_trajectory_by_as_many_periods(robot: Robot) -> None:
    robot.put_into(PAUSED)
    robot.send(swing())
    with robot.listening(STATE, f"{ARM}/controller_state") as heard:
        robot.wait_until_found(heard)
        for steps, total in ((1, 1), (9, 10), (40, 50)):
            robot.step(steps)
            due_ns = (total - 1) * STEP_NS
            robot.wait_until(lambda: stamp_ns(heard[-1].header.stamp) == due_ns, "the state")  # noqa: B023
            assert stamp_ns(heard[-1].reference.time_from_start) == due_ns
            assert robot.now_ns() == total * STEP_NS


def test_after_a_reset_the_start_posture_is_held(robot: Robot) -> None:
    robot.outcome(robot.send(goal(ARM, 0.5, arm_right_4_joint=-0.8)))
    robot.reset()
    robot.put_into(PAUSED)
    robot.step(200)
    with robot.listening(STATE, f"{ARM}/controller_state") as heard:
        robot.step(1)
        robot.wait_until(lambda: bool(heard), "the state")
    assert list(heard[-1].output.positions) == [POSTURE[joint] for joint in TALOS.controllers[ARM]]
    assert heard[-1].feedback.positions[TALOS.controllers[ARM].index(ELBOW)] == pytest.approx(POSTURE[ELBOW], abs=1e-3)


@pytest.fixture(scope="module")
def other(endpoint: str, session: Context, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    """A simulation in which every configurable behaviour of controllers differs from its default."""
    options = ControllersConfig(hold="decelerate", topic_aborts_goal=True, refused_goals="abort")
    config = CONFIG.model_copy(update={"controllers": options})
    with running_simulation(tmp_path_factory.mktemp("other"), endpoint, session, "sim_1", config) as robot:
        yield robot


def test_goals_that_are_refused_can_be_accepted_and_aborted_with_the_reason(other: Robot) -> None:
    other.reset()
    wish = goal(ARM)
    wish.trajectory.joint_names = list(TALOS.controllers["arm_left_controller"])
    handle = other.send(wish, ARM)
    assert handle.accepted
    status, code, text = other.outcome(handle)
    assert (status, code) == (ABORTED, -2)
    assert text.startswith(f"{ARM}: Incoming joint arm_left_1_joint doesn't match the controller's joints.")
    locked = other.outcome(other.send(goal(ARM, arm_right_5_joint=0.4), ARM))
    assert locked[:2] == (ABORTED, -1)
    assert "arm_right_5_joint is locked at 0 rad" in locked[2]
    assert other.now_ns() == 0
