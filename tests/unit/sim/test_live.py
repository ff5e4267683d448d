from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.control.bench import through

from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.control.values import GoalStatus, TrajectoryGoal, TrajectoryPoint
from throwcollect.engines.engine import BodyState
from throwcollect.errors import ConfigError, RequestError
from throwcollect.robots.description import start_posture
from throwcollect.robots.talos import TALOS
from throwcollect.sim.live import LiveSimulator, StateCode
from throwcollect.sim.present_trial import trial_goals

CONFIG = Config()
POSTURE = start_posture(CONFIG)
ARM, TORSO, HEAD = "arm_right_controller", "torso_controller", "head_controller"


def goal(controller: str, duration_s: float = 1.0, **ends: float) -> TrajectoryGoal:
    joints = TALOS.controllers[controller]
    still = [0.0] * len(joints)
    start = [POSTURE[joint] for joint in joints]
    end = [ends.get(joint, POSTURE[joint]) for joint in joints]
    points = (TrajectoryPoint(0, start, still, still), TrajectoryPoint(round(duration_s * 1e9), end, still, still))
    return TrajectoryGoal(through(points, joints))


def swing() -> TrajectoryGoal:
    return goal(ARM, arm_right_4_joint=-0.5, arm_right_7_joint=0.5)


@pytest.fixture(scope="module")
def shared() -> Iterator[LiveSimulator]:
    simulation = LiveSimulator(CONFIG)
    yield simulation
    simulation.close()


@pytest.fixture
def simulation(shared: LiveSimulator) -> LiveSimulator:
    shared.trial.set_up_nothing()
    shared.state = StateCode.PLAYING
    shared.reset()
    shared.pop_results()
    return shared


def run(simulation: LiveSimulator) -> None:
    for _ in range(1000):
        if not simulation.running:
            return
        simulation.advance(watched=True)
    pytest.fail("the run does not end")


def test_a_trial_yields_its_episode_once_and_with_the_results_of_its_goals(simulation: LiveSimulator) -> None:
    simulation.begin(3, {})
    run(simulation)
    episode = simulation.take_recording()
    assert episode is not None
    header, samples, states = episode
    assert (header.trial, header.end_reason, header.start_ns) == (3, "landed", CONFIG.trial_start_ns(3))
    assert [(each.controller, each.status) for each in header.goals] == [(ARM, 4), (TORSO, 4)]
    assert header.samples == len(samples.stamps_ns)
    assert states == {}
    assert simulation.take_recording() is None


def test_the_same_trial_gives_the_same_samples_however_it_is_divided(simulation: LiveSimulator) -> None:
    simulation.begin(0, {})
    run(simulation)
    whole = simulation.take_recording()
    simulation.begin(0, {})
    simulation.state = StateCode.PAUSED
    for steps in (1, 2, 77, 3, 400, 1000):
        simulation.step(steps)
    divided = simulation.take_recording()
    assert whole is not None
    assert divided is not None
    assert whole[0] == divided[0]
    for name, column in vars(whole[1]).items():
        assert np.array_equal(column, getattr(divided[1], name)), name


def test_joints_are_at_the_trajectory_when_their_sample_is_taken(simulation: LiveSimulator) -> None:
    simulation.begin_recording()
    assert simulation.submit(ARM, 1, swing()) is None
    run(simulation)
    recorded = simulation.end_recording()
    assert recorded is not None
    samples = recorded[1]
    x = np.minimum((samples.stamps_ns - samples.stamps_ns[0]) / 1e9, 1.0)
    wanted = -1.9 + (10 * x**3 - 15 * x**4 + 6 * x**5) * 1.4
    assert np.abs(samples.position[:, 10] - wanted).max() < 1e-4


def test_desired_and_measured_state_of_a_controller_are_of_the_same_instant(simulation: LiveSimulator) -> None:
    simulation.submit(ARM, 1, goal(ARM, 2.0, arm_right_4_joint=-0.5))
    simulation.step(500)
    state, now_ns = simulation.observe(ARM).state(simulation.now_ns), simulation.now_ns
    elbow = TALOS.controllers[ARM].index("arm_right_4_joint")
    assert state.stamp_ns == state.desired.time_from_start_ns == state.actual.time_from_start_ns == now_ns
    assert abs(state.desired.velocities[elbow]) > 0.5
    assert state.error.positions == pytest.approx(np.zeros(len(TALOS.controllers[ARM])), abs=1e-4)
    assert simulation.observe(HEAD).state(simulation.now_ns).stamp_ns == now_ns


def test_a_goal_that_moves_a_locked_joint_is_refused_by_name(simulation: LiveSimulator) -> None:
    refusal = simulation.submit(HEAD, 1, goal(HEAD, head_1_joint=0.2))
    assert refusal is not None
    assert refusal.text == f"{HEAD}: head_1_joint is locked at 0 rad (robot.locked) and cannot go to 0.2 rad"
    assert not simulation.running


def test_a_locked_limb_carries_out_a_goal_that_does_not_move_it(simulation: LiveSimulator) -> None:
    assert simulation.submit(HEAD, 5, goal(HEAD, duration_s=0.2)) is None
    run(simulation)
    assert [(name, result.status) for name, result in simulation.pop_results()] == [(HEAD, GoalStatus.SUCCEEDED)]


def test_without_a_trial_the_run_ends_when_limbs_and_ball_are_at_rest(simulation: LiveSimulator) -> None:
    assert simulation.submit(ARM, 1, swing()) is None
    run(simulation)
    assert simulation.world.end_reason == "landed"
    assert simulation.take_recording() is None
    ended = simulation.now_ns
    assert simulation.submit(ARM, 2, goal(ARM, arm_right_4_joint=-1.0)) is None
    run(simulation)
    assert simulation.now_ns - ended > 1e9
    assert [result.status for _, result in simulation.pop_results()] == [GoalStatus.SUCCEEDED] * 2


@pytest.mark.parametrize("engine", ["bullet", "mujoco", "ballistic"])
def test_without_a_trial_the_ground_stops_the_ball_and_the_clock_runs_until_then(engine: str) -> None:
    config = Config.model_validate({"sim": {"engine": engine}, "ball": {"restitution": 0.5}})
    simulation = LiveSimulator(config)
    # The second fall begins after the longest duration of a trial.
    for number, duration_s in enumerate((7.0, 0.02)):
        simulation.world.place("ball", BodyState((2.0, 0.0, 1.0)))
        assert simulation.submit(ARM, number, goal(ARM, duration_s)) is None
        run(simulation)
        ball = simulation.world.bodies["ball"]
        assert ball.position == pytest.approx((2.0, 0.0, config.ball.radius_m), abs=2e-3)
        assert np.hypot(*ball.linear_velocity[:2]) + abs(ball.linear_velocity[2]) < 0.01
    simulation.close()


def test_a_ball_that_rolls_for_ever_keeps_the_clock_running_for_as_long_as_a_trial(simulation: LiveSimulator) -> None:
    assert simulation.submit(ARM, 1, swing()) is None
    run(simulation)
    rolling = simulation.world.bodies["ball"]
    assert rolling.position[2] == pytest.approx(CONFIG.ball.radius_m, abs=1e-3)
    assert rolling.linear_velocity[0] > 1.0
    assert simulation.now_ns / 1e9 == pytest.approx(1.0 + CONFIG.sim.max_trial_s, abs=0.1)


def test_a_reset_aborts_goals_and_goes_back_to_the_start(simulation: LiveSimulator) -> None:
    simulation.begin(0, {})
    simulation.advance(watched=True)
    simulation.reset()
    assert [(result.status, result.error_string) for _, result in simulation.pop_results()] == [
        (GoalStatus.ABORTED, "simulation was reset")
    ] * 2
    assert simulation.now_ns == CONFIG.trial_start_ns(0)
    assert not simulation.running


def test_requested_steps_are_taken_stretch_by_stretch(simulation: LiveSimulator) -> None:
    simulation.set_state(StateCode.PAUSED)
    request = simulation.request_steps(60)
    assert simulation.running
    simulation.advance(watched=True)
    assert (request.taken, request.is_over) == (25, False)
    with pytest.raises(RequestError, match="25 of 60 steps of another request") as refused:
        simulation.request_steps(1)
    assert refused.value.reason == "RESULT_INCORRECT_STATE"
    simulation.advance(watched=False)
    assert (request.taken, request.is_over, request.interruption) == (60, True, None)
    assert not simulation.running
    assert simulation.now_ns == 60 * 10**9 // CONFIG.sim.physics_hz


def test_steps_are_refused_unless_the_simulation_is_paused(simulation: LiveSimulator) -> None:
    with pytest.raises(RequestError, match="paused only; it is PLAYING") as refused:
        simulation.request_steps(1)
    assert refused.value.reason == "RESULT_OPERATION_FAILED"


def test_a_request_for_zero_steps_is_over_at_once(simulation: LiveSimulator) -> None:
    simulation.set_state(StateCode.PAUSED)
    assert simulation.request_steps(0).is_over
    assert not simulation.running


@pytest.mark.parametrize(
    ("interrupt", "reason"),
    [
        (lambda simulation: simulation.reset(state=False), "the simulation was reset"),
        (lambda simulation: simulation.reset(time=False), "the simulation was reset"),
        (lambda simulation: simulation.set_state(StateCode.QUITTING), "the simulation is QUITTING now"),
    ],
)
def test_a_reset_or_quitting_interrupts_steps(interrupt, reason: str, simulation: LiveSimulator) -> None:
    simulation.set_state(StateCode.PAUSED)
    request = simulation.request_steps(10**9)
    simulation.advance(watched=True)
    interrupt(simulation)
    assert (request.is_over, request.interruption) == (True, reason)
    assert not simulation.running


def test_a_reset_of_time_leaves_the_robot_where_it_is(simulation: LiveSimulator) -> None:
    simulation.set_state(StateCode.PAUSED)
    assert simulation.submit(ARM, 1, swing()) is None
    simulation.step(250)
    simulation.reset(state=False)
    before = simulation.world.joints()[0]
    ball = simulation.world.bodies["ball"]
    assert simulation.now_ns == 0
    assert simulation.world.recorded == 1
    assert simulation.world.samples().object_position[0].tolist() == list(ball.position)
    # Stopped at full speed, joints whose effort is limited give way for a moment.
    simulation.step(500)
    assert simulation.world.joints()[0] == pytest.approx(before, abs=2e-3)


def test_set_points_are_kept_with_each_sample_when_they_are_recorded() -> None:
    config = Config.model_validate({"record": {"topics": ["joint_states", "ball/odometry", "controller_state"]}})
    simulation = LiveSimulator(config)
    simulation.begin(0, {})
    run(simulation)
    kept = simulation.take_recording()
    assert kept is not None
    header, samples, states = kept
    assert len(states[ARM].position) == header.samples
    elbow = TALOS.controllers[ARM].index("arm_right_4_joint")
    assert np.abs(states[ARM].position[:, elbow] - samples.position[:, 10]).max() < 1e-4
    assert states[ARM].elapsed_ns[5] == samples.stamps_ns[5] - samples.stamps_ns[0]
    simulation.close()


@pytest.mark.parametrize(("leased", "watched", "samples"), [(True, False, 12), (True, True, 1), (False, False, 1)])
def test_a_leased_trial_without_listeners_advances_in_long_stretches(
    simulation: LiveSimulator, *, leased: bool, watched: bool, samples: int
) -> None:
    if leased:
        simulation.begin(0, {})
    else:
        assert simulation.submit(ARM, 1, swing()) is None
    simulation.real_time_factor = 1.0
    simulation.fresh_samples()
    simulation.advance(watched=watched)
    simulation.real_time_factor = None
    assert len(simulation.fresh_samples()) == samples
    simulation.drop()


def test_samples_come_one_by_one_after_steps_that_ended_between_two(simulation: LiveSimulator) -> None:
    simulation.state = StateCode.PAUSED
    simulation.request_steps(3)
    simulation.advance(watched=True)
    simulation.state = StateCode.PLAYING
    assert simulation.submit(ARM, 1, swing()) is None
    simulation.real_time_factor = 1.0
    simulation.fresh_samples()
    simulation.advance(watched=True)
    simulation.real_time_factor = None
    assert simulation.now_ns == 4 * 10**9 // CONFIG.sim.physics_hz
    assert len(simulation.fresh_samples()) == 1


def test_after_a_failed_reset_the_clock_stands_still_until_one_succeeds() -> None:
    config = Config.model_validate({"sim": {"engine": "ballistic"}, "tool": {"cup_floor_radius_m": 0.006}})
    simulation = LiveSimulator(config)
    simulation.submit(ARM, 1, swing())
    simulation.advance(watched=True)
    simulation.trial.config = with_values(config, {"ball.radius_m": 0.005})
    with pytest.raises(ConfigError, match=r"tool\.cup_floor_radius_m"):
        simulation.reset()
    assert simulation.submit(ARM, 2, swing()) is None
    assert not simulation.running
    simulation.state = StateCode.PAUSED
    with pytest.raises(RequestError, match="there is no start state until a reset succeeds"):
        simulation.request_steps(1)
    simulation.state = StateCode.PLAYING
    simulation.trial.config = config
    simulation.reset()
    simulation.submit(ARM, 3, swing())
    run(simulation)
    assert [result.status for _, result in simulation.pop_results()][-1] == GoalStatus.SUCCEEDED


def test_recording_is_the_same_as_a_trial_with_its_goals(simulation: LiveSimulator) -> None:
    simulation.begin(0, {})
    motion = simulation.trial.motion
    assert motion is not None
    run(simulation)
    handed = simulation.hand_over()
    assert handed is not None
    leased = handed.samples(TALOS.joints)
    simulation.pop_results()

    simulation.begin_recording()
    for controller, wish in trial_goals(TALOS, motion, POSTURE).items():
        assert simulation.submit(controller, controller, wish) is None
    run(simulation)
    assert simulation.hand_over() is None
    assert simulation.recording_ended
    recorded = simulation.end_recording()
    assert recorded is not None
    header, samples = recorded
    assert (header.end_reason, len(header.goals)) == ("landed", 2)
    assert np.array_equal(samples.position, leased.position)
    assert np.array_equal(samples.object_position, leased.object_position)
    # Commands are those of the next sample; the motors have followed them by then.
    moved = [TALOS.joints.index(joint) for joint in CONFIG.moving_joints]
    assert samples.command.shape == (len(samples), 2, len(moved))
    assert np.abs(samples.command[:-1, 1] - samples.position[1:, moved]).max() < 1e-3
    assert np.abs(samples.command[:-1, 1] - samples.position[:-1, moved]).max() > 1e-2
    assert not simulation.records


def test_recording_goes_on_while_all_rests_and_ends_when_its_time_is_over(simulation: LiveSimulator) -> None:
    def move(number: int, duration_s: float) -> None:
        wish = goal(ARM, duration_s, arm_right_4_joint=POSTURE["arm_right_4_joint"] + 0.1 * number)
        # Without its first point, a trajectory begins where the arm is.
        names = "times_ns", "positions", "velocities", "accelerations", "effort"
        later = replace(wish.trajectory, **{name: getattr(wish.trajectory, name)[1:] for name in names})
        assert simulation.submit(ARM, number, TrajectoryGoal(later)) is None
        run(simulation)

    simulation.begin_recording()
    for number in range(3):
        move(number, 0.5)
        assert simulation.world.rests
        assert not simulation.recording_ended
    move(3, 9.0)
    assert simulation.recording_ended
    recorded = simulation.end_recording()
    assert recorded is not None
    assert recorded[0].end_reason == "timeout"
    assert recorded[1].seconds_since(recorded[0].start_ns)[-1] == CONFIG.sim.max_trial_s


def test_reset_ends_a_recording_without_an_episode(simulation: LiveSimulator) -> None:
    simulation.begin_recording()
    with pytest.raises(RequestError, match="a recording runs already"):
        simulation.begin_recording()
    simulation.reset()
    assert not simulation.records
    simulation.trial.config = with_values(CONFIG, {"ball.mass_kg": 0.1})
    with pytest.raises(RequestError, match="other physics than the file"):
        simulation.begin_recording()


def test_recording_has_no_body_that_jumps(simulation: LiveSimulator) -> None:
    simulation.begin_recording()
    simulation.place("ball", BodyState((1.0, 0.0, 1.0)))
    simulation.submit(ARM, 1, goal(ARM))
    simulation.advance(watched=True)
    with pytest.raises(RequestError, match="before its first step"):
        simulation.place("ball", BodyState((1.0, 0.0, 1.0)))
    recorded = simulation.end_recording()
    assert recorded is not None
    assert recorded[1].object_position[0].tolist() == [1.0, 0.0, 1.0]
