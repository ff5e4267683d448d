import time
from collections.abc import Iterator

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.control import GoalStatus, Trajectory, TrajectoryGoal, TrajectoryPoint
from throwcollect.robots.description import start_posture
from throwcollect.robots.talos import CONTROLLERS
from throwcollect.sim.recording import BallState
from throwcollect.sim.simulation import Simulation, State, TrialSetup

CONFIG = Config()
POSTURE = start_posture(CONFIG)
ARM, TORSO, HEAD = "arm_right_controller", "torso_controller", "head_controller"


def goal(controller: str, duration_s: float = 1.0, **ends: float) -> TrajectoryGoal:
    joints = CONTROLLERS[controller]
    still = [0.0] * len(joints)
    start = [POSTURE[joint] for joint in joints]
    end = [ends.get(joint, POSTURE[joint]) for joint in joints]
    points = (TrajectoryPoint(0, start, still, still), TrajectoryPoint(round(duration_s * 1e9), end, still, still))
    return TrajectoryGoal(Trajectory(joints, points))


def swing() -> TrajectoryGoal:
    return goal(ARM, arm_right_4_joint=-0.5, arm_right_7_joint=0.5)


@pytest.fixture(scope="module")
def shared() -> Iterator[Simulation]:
    simulation = Simulation(CONFIG)
    yield simulation
    simulation.world.close()


@pytest.fixture
def simulation(shared: Simulation) -> Simulation:
    shared.setup = TrialSetup(-1, (), CONFIG)
    shared.state = State.PLAYING
    shared.reset()
    shared.pop_results()
    return shared


def run(simulation: Simulation) -> None:
    for _ in range(1000):
        if not simulation.running:
            return
        simulation.advance(watched=True)
    pytest.fail("the run does not end")


def trial(simulation: Simulation, number: int = 0) -> None:
    simulation.setup = TrialSetup(number, (ARM, TORSO), CONFIG)
    simulation.reset()
    assert simulation.submit(ARM, 1, swing()) is None
    assert not simulation.running
    assert simulation.submit(TORSO, 2, goal(TORSO)) is None


def test_the_clock_stands_still_until_every_awaited_controller_has_a_goal(simulation: Simulation) -> None:
    trial(simulation)
    assert simulation.running
    assert simulation.now_ns == CONFIG.trial_start_ns(0)


def test_a_trial_yields_its_episode_once_and_with_the_results_of_its_goals(simulation: Simulation) -> None:
    trial(simulation, 3)
    run(simulation)
    episode = simulation.episode()
    assert episode is not None
    header, samples, states = episode
    assert (header.trial, header.end_reason, header.start_ns) == (3, "landed", CONFIG.trial_start_ns(3))
    assert [(each.controller, each.status) for each in header.goals] == [(ARM, 4), (TORSO, 4)]
    assert header.samples == len(samples.stamps_ns)
    assert states == {}
    assert simulation.episode() is None


def test_the_same_trial_gives_the_same_samples_however_it_is_sliced(simulation: Simulation) -> None:
    trial(simulation)
    run(simulation)
    whole = simulation.episode()
    trial(simulation)
    simulation.state = State.PAUSED
    for steps in (1, 2, 77, 3, 400, 1000):
        simulation.step(steps)
    sliced = simulation.episode()
    assert whole is not None
    assert sliced is not None
    assert whole[0] == sliced[0]
    for name, column in vars(whole[1]).items():
        assert np.array_equal(column, getattr(sliced[1], name)), name


def test_joints_are_at_the_trajectory_when_their_sample_is_taken(simulation: Simulation) -> None:
    trial(simulation)
    run(simulation)
    episode = simulation.episode()
    assert episode is not None
    samples = episode[1]
    x = np.minimum((samples.stamps_ns - samples.stamps_ns[0]) / 1e9, 1.0)
    wanted = -1.9 + (10 * x**3 - 15 * x**4 + 6 * x**5) * 1.4
    assert np.abs(samples.position[:, 10] - wanted).max() < 1e-4


def test_a_goal_that_moves_a_locked_joint_is_refused_by_name(simulation: Simulation) -> None:
    refusal = simulation.submit(HEAD, 1, goal(HEAD, head_1_joint=0.2))
    assert refusal == f"{HEAD}: head_1_joint is locked at 0 rad (robot.locked) and cannot go to 0.2 rad"
    assert not simulation.running


def test_a_limb_of_locked_joints_still_carries_out_goals_that_keep_it_where_it_is(simulation: Simulation) -> None:
    assert simulation.submit(HEAD, 5, goal(HEAD, duration_s=0.2)) is None
    run(simulation)
    assert [(name, result.status) for name, result in simulation.pop_results()] == [(HEAD, GoalStatus.SUCCEEDED)]


def test_without_a_trial_the_run_ends_when_limbs_and_ball_are_at_rest(simulation: Simulation) -> None:
    assert simulation.submit(ARM, 1, swing()) is None
    run(simulation)
    assert simulation.world.end_reason == "landed"
    assert simulation.episode() is None
    ended = simulation.now_ns
    assert simulation.submit(ARM, 2, goal(ARM, arm_right_4_joint=-1.0)) is None
    run(simulation)
    assert simulation.now_ns - ended > 1e9
    assert [result.status for _, result in simulation.pop_results()] == [GoalStatus.SUCCEEDED] * 2


def test_a_reset_aborts_goals_and_goes_back_to_the_start(simulation: Simulation) -> None:
    trial(simulation)
    simulation.advance(watched=True)
    simulation.reset()
    assert [(result.status, result.error_string) for _, result in simulation.pop_results()] == [
        (GoalStatus.ABORTED, "simulation was reset")
    ] * 2
    assert simulation.now_ns == CONFIG.trial_start_ns(0)
    assert not simulation.running


def test_a_cancelled_goal_stops_where_it_is(simulation: Simulation) -> None:
    assert simulation.submit(ARM, 1, swing()) is None
    for _ in range(10):
        simulation.advance(watched=True)
    assert simulation.cancel(ARM, 1)
    run(simulation)
    positions = simulation.world.joint_positions()
    elbow = positions[simulation.world.moving.index("arm_right_4_joint")]
    assert -1.3 < elbow < -1.1
    assert [result.status for _, result in simulation.pop_results()] == [GoalStatus.CANCELED]


def test_while_paused_steps_advance_the_clock_exactly(simulation: Simulation) -> None:
    simulation.set_state(State.PAUSED)
    simulation.step(10)
    assert simulation.now_ns == 10 * 10**9 // CONFIG.sim.physics_hz


def test_the_ball_can_be_put_somewhere_and_the_robot_cannot(simulation: Simulation) -> None:
    assert simulation.set_entity_state("ball", BallState((1.0, 0.0, 1.0)))
    ball = simulation.entity_state("ball")
    assert ball is not None
    assert ball.position == (1.0, 0.0, 1.0)
    assert not simulation.set_entity_state("talos", BallState((0.0, 0.0, 1.0)))
    assert simulation.entity_state("table") is None


def test_set_points_are_kept_with_each_sample_when_they_are_recorded() -> None:
    config = Config.model_validate({"record": {"topics": ["joint_states", "ball/odometry", "controller_state"]}})
    simulation = Simulation(config)
    trial(simulation)
    run(simulation)
    kept = simulation.episode()
    assert kept is not None
    header, samples, states = kept
    assert len(states[ARM].position) == header.samples
    elbow = CONTROLLERS[ARM].index("arm_right_4_joint")
    assert np.abs(states[ARM].position[:, elbow] - samples.position[:, 10]).max() < 1e-4
    assert states[ARM].elapsed_ns[5] == samples.stamps_ns[5] - samples.stamps_ns[0]
    simulation.world.close()


def test_a_real_time_factor_holds_the_clock_back(simulation: Simulation) -> None:
    trial(simulation)
    simulation.real_time_factor = 1.0
    began = time.monotonic()
    simulation.advance(watched=True)
    simulation.real_time_factor = None
    assert time.monotonic() - began >= 0.05
