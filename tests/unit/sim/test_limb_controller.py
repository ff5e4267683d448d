"""Limbs of a simulation: the configuration and the published state of their controllers."""

import numpy as np
import pytest
from tests.unit.control.bench import through

from throwcollect.config.schema import Config
from throwcollect.control.parameters import ControllerParameters, JointConstraints
from throwcollect.control.values import GoalStatus, TrajectoryGoal, TrajectoryPoint
from throwcollect.robots.description import start_posture
from throwcollect.robots.talos import TALOS
from throwcollect.sim.live import LiveSimulator

ARM, HEAD = "arm_right_controller", "head_controller"
POSTURE = start_posture(Config())
ELBOW = TALOS.controllers[ARM].index("arm_right_4_joint")


def simulation(**options: object) -> LiveSimulator:
    return LiveSimulator(Config.model_validate({"controllers": options}))


def goal(seconds: float, elbow: float = -1.0) -> TrajectoryGoal:
    positions = [POSTURE[joint] for joint in TALOS.controllers[ARM]]
    positions[ELBOW] = elbow
    return TrajectoryGoal(through([TrajectoryPoint(round(seconds * 1e9), positions)], TALOS.controllers[ARM]))


def parameters_of(name: str, **options: object) -> ControllerParameters:
    return simulation(**options).limbs[name].controller.parameters


def test_talos_has_a_goal_tolerance_and_no_path_tolerance() -> None:
    parameters = parameters_of(HEAD)
    assert parameters.joints == ("head_1_joint", "head_2_joint")
    assert not parameters.measures_velocity
    assert (parameters.constraints.goal_time, parameters.constraints.stopped_velocity_tolerance) == (0.6, 0.05)
    assert set(parameters.constraints.joints.values()) == {JointConstraints(trajectory=0.0, goal=0.02)}
    assert set(parameters.constraints.joints) == set(parameters.joints)


@pytest.mark.parametrize("seconds", [0.1, 0.7])
def test_a_result_comes_at_the_same_time_in_stretches_and_in_steps(seconds: float) -> None:
    ends = []
    for go_on in (lambda world: world.advance(watched=False), lambda world: world.step(1)):
        world, results = simulation(), []
        world.submit(ARM, 1, goal(seconds))
        while not results:
            go_on(world)
            results = world.pop_results()
        ((_, result),) = results
        assert result.status == GoalStatus.SUCCEEDED
        ends.append(world.now_ns)
    assert ends[0] == ends[1]


def test_a_watched_limb_yields_the_state_of_every_control_period() -> None:
    world = simulation()
    world.watch([ARM, HEAD])
    world.submit(ARM, 1, goal(0.5))
    world.step(100)
    period_ns = 10**9 // world.config.sim.physics_hz
    for name in (ARM, HEAD):
        states = world.limbs[name].pop_states()
        assert [state.stamp_ns for state in states] == [period_ns * number for number in range(100)]
    assert [name for name, limb in world.limbs.items() if limb.pop_states()] == []
    world.watch([])
    world.step(10)
    assert world.limbs[ARM].pop_states() == []


def test_watching_a_limb_again_yields_no_earlier_states() -> None:
    world = simulation()
    world.watch([ARM])
    world.submit(ARM, 1, goal(0.5))
    world.step(10)
    world.watch([])
    world.watch([ARM])
    assert world.limbs[ARM].pop_states() == []


def test_watching_a_limb_does_not_change_its_motion() -> None:
    positions = []
    for watched in ([], [ARM, HEAD]):
        world = simulation()
        world.watch(watched)
        world.submit(ARM, 1, goal(0.5))
        world.step(400)
        positions.append(world.world.joints()[0])
    assert positions[0] == positions[1]


def stop_swing(**options: object) -> tuple[np.ndarray, np.ndarray]:
    """Command and measured elbow, before and after a cancelled swing of an arm that lags."""
    world = LiveSimulator(Config.model_validate({"controllers": options, "robot": {"effort_scale": 0.2}}))
    world.submit(ARM, 1, goal(0.4, elbow=-0.3))
    world.step(150)
    before = world.observe(ARM).state(world.now_ns)
    assert world.cancel(ARM, 1)
    world.step(1)
    after = world.observe(ARM).state(world.now_ns)
    return np.array([[each.output.positions[ELBOW], each.actual.positions[ELBOW]] for each in (before, after)])


def test_a_cancelled_goal_leaves_the_joints_where_they_are_measured_or_commanded() -> None:
    measured, command = stop_swing(), stop_swing(hold="command")
    lag = abs(measured[0, 0] - measured[0, 1])
    assert lag > 0.01
    assert measured[1, 0] == pytest.approx(measured[0, 1], abs=1e-9)
    assert command[1, 0] == command[0, 0]


def test_joints_can_brake_when_a_goal_is_cancelled() -> None:
    world = simulation(hold="decelerate", max_deceleration_radps2=5.0)
    world.submit(ARM, 1, goal(0.5, elbow=-1.4))
    world.step(150)
    speed = world.observe(ARM).state(world.now_ns).actual.velocities[ELBOW]
    assert speed == pytest.approx(1.0, abs=0.05)
    position = world.observe(ARM).state(world.now_ns).actual.positions[ELBOW]
    world.cancel(ARM, 1)
    # The first step ends early, because it brings the result of the goal.
    assert world.step(300) == 1
    world.step(300)
    state = world.observe(ARM).state(world.now_ns)
    assert state.output.positions[ELBOW] == pytest.approx(position + speed**2 / 2 / 5.0, abs=1e-6)
    assert state.actual.positions[ELBOW] == pytest.approx(state.output.positions[ELBOW], abs=0.005)


def test_a_velocity_that_would_move_a_locked_joint_is_refused_by_name() -> None:
    limb = simulation().limbs[HEAD]
    joints = TALOS.controllers[HEAD]
    still, turning = ([TrajectoryPoint(10**9, velocities=[0.0, speed])] for speed in (0.0, 0.1))
    assert limb.refuse_locked(through(still, joints)) is None
    refusal = limb.refuse_locked(through(turning, joints))
    assert refusal is not None
    assert refusal.text == f"{HEAD}: head_2_joint is locked at 0 rad (robot.locked) and cannot move"
