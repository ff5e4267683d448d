from __future__ import annotations

import math
from dataclasses import astuple, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from throwcollect.config.schema import Config
from throwcollect.episode.record import Contact, GoalOutcome
from throwcollect.robots.dynamics import ToolMotion
from throwcollect.robots.robot import joint_limits
from throwcollect.robots.talos import TALOS
from throwcollect.tasks.free_flight import ballistic_positions
from throwcollect.tasks.task import task_of
from throwcollect.tasks.throw.throw_result import ThrowOutcome

from .episodes import GRAVITY, ORIGIN, RELEASE_S, VELOCITY, episode, landing_time, parabola

HELD = ("spoon", 0.0, RELEASE_S)
ELBOW = TALOS.joints.index("arm_right_4_joint")
GRIPPER = TALOS.joints.index("gripper_left_joint")
RADIUS = Config().ball.radius_m


def judge(samples, header, config=None):
    task = task_of(config or Config())
    return task.judge(samples, header, task.trajectory())


def test_a_landed_throw_has_all_its_measures():
    result = judge(*episode())
    assert (result.outcome, result.reason) == (ThrowOutcome.LANDED, None)
    assert result.release.time_s == pytest.approx(RELEASE_S, abs=1e-9)
    end = landing_time(RADIUS)
    position, velocity = parabola(np.array([end]))
    assert result.landing.time_s == pytest.approx(end, abs=1e-9)
    assert result.landing.position == pytest.approx(position[0], abs=1e-9)
    assert result.landing.velocity == pytest.approx(velocity[0], abs=1e-8)
    assert result.flight_time_s == pytest.approx(end - RELEASE_S, abs=1e-9)
    assert result.hit_angle_rad == pytest.approx(math.atan2(-velocity[0][2], np.hypot(*velocity[0][:2])), abs=1e-9)
    assert result.apex.time_s == pytest.approx(RELEASE_S + VELOCITY[2] / GRAVITY, abs=1e-6)
    assert result.apex.position[2] == pytest.approx(ORIGIN[2] + VELOCITY[2] ** 2 / (2 * GRAVITY), abs=1e-6)
    assert result.recontacts == 0
    # The physics goes in steps, which are not quite on a parabola.
    assert 0.005 < result.ballistic_residual_m < 0.01
    assert result.effort_saturated_share == 0
    assert max(result.tracking_error_rad.values()) < 1e-12
    assert result.velocity_peak.joint == "arm_right_7_joint"
    assert result.velocity_peak.share == pytest.approx(0.686, abs=2e-3)


def test_a_resting_joint_with_limits_of_0_does_not_spoil_the_result(monkeypatch):
    limits = joint_limits(TALOS)
    zero = {name: np.where(np.arange(32) == GRIPPER, 0.0, getattr(limits, name)) for name in ("velocity", "effort")}
    expected = judge(*episode())
    monkeypatch.setattr("throwcollect.tasks.joint_measures.joint_limits", lambda _: replace(limits, **zero))
    assert judge(*episode()) == expected


def test_spin_is_that_of_the_first_sample_after_the_release():
    samples, header = episode()
    spins = np.arange(3.0 * len(samples)).reshape(-1, 3)
    result = judge(replace(samples, object_angular_velocity=spins), header)
    first = int(np.argmax((samples.stamps_ns - header.start_ns) / 1e9 >= RELEASE_S))
    assert result.release_spin == tuple(spins[first])


def test_judging_leaves_the_samples_as_they_are():
    (samples, header), (untouched, _) = episode(), episode()
    judge(samples, header)
    assert all((column == getattr(untouched, name)).all() for name, column in vars(samples).items())


def test_ball_at_release_lies_between_its_neighbouring_samples():
    # Constant acceleration before the release as after it, so that the cubic is exact on the whole interval.
    samples, header = episode()
    times = (samples.stamps_ns - header.start_ns) / 1e9 - RELEASE_S
    g = np.array([0, 0, -GRAVITY])
    samples = replace(
        samples,
        object_position=ORIGIN + VELOCITY * times[:, None] + g * times[:, None] ** 2 / 2,
        object_linear_velocity=VELOCITY + g * times[:, None],
    )
    result = judge(samples, header)
    assert result.release.position == pytest.approx(ORIGIN, abs=1e-12)
    assert result.release.velocity == pytest.approx(VELOCITY, abs=1e-12)
    assert result.release_speed_mps == pytest.approx(np.linalg.norm(VELOCITY), abs=1e-12)
    assert result.release_elevation_rad == pytest.approx(math.atan2(0.34, math.hypot(2.18, 0.16)), abs=1e-12)


@settings(max_examples=40, deadline=None)
@given(
    height=st.floats(0, 1.5), rate=st.sampled_from([50, 250, 500]), vx=st.floats(-3, 3), vz=st.floats(-2, 3),
)  # fmt: skip
def test_landing_between_samples_is_exact_for_a_parabola(height, rate, vx, vz):
    base = Config()
    config = base.model_copy(update={"scene": base.scene.model_copy(update={"landing_height_m": height})})
    velocity = np.array([vx, 0.1, vz])
    samples, header = episode(duration_s=2.0, rate_hz=rate, velocity=velocity)
    # Start the ball on its parabola early, so that the release falls into a smooth interval.
    times = ((samples.stamps_ns - header.start_ns) / 1e9 - RELEASE_S)[:, None]
    g = np.array([0, 0, -GRAVITY])
    samples = replace(
        samples,
        object_position=ORIGIN + velocity * times + g * times**2 / 2,
        object_linear_velocity=velocity + g * times,
    )
    end = landing_time(height + RADIUS, velocity=velocity)
    result = judge(samples, header, config)
    assert result.landing.time_s == pytest.approx(end, abs=1e-9)
    assert result.landing.position[2] == pytest.approx(height + RADIUS, abs=1e-9)
    assert result.landing.position[0] == pytest.approx(ORIGIN[0] + vx * (end - RELEASE_S), abs=1e-8)
    assert result.apex.position[2] >= result.release.position[2] - 1e-12
    assert result.apex.time_s <= result.landing.time_s


def test_ball_that_stays_in_the_spoon_is_not_released():
    result = judge(*episode(contacts=(("spoon", 0.0, None),), end_reason="timeout"))
    assert result.outcome is ThrowOutcome.NOT_RELEASED
    assert result.reason == "the ball stayed in the spoon"
    assert (result.release, result.apex, result.landing, result.recontacts) == (None, None, None, None)
    assert result.velocity_peak is not None


def test_ball_that_left_the_spoon_before_the_start_is_dropped():
    lost = "the ball had left the spoon before the start, in the sim.settle_s = 0.05 s for settling"
    result = judge(*episode(contacts=()))
    assert (result.outcome, result.reason, result.release) == (ThrowOutcome.DROPPED, lost, None)
    result = judge(*episode(contacts=(("spoon", 0.6, RELEASE_S),)))
    assert (result.outcome, result.reason) == (ThrowOutcome.DROPPED, lost)
    assert result.landing is not None


def test_ball_on_a_bounce_at_the_start_is_in_the_spoon():
    samples, header = episode(contacts=(("spoon", 0.01, RELEASE_S),))
    samples.object_position[0] = ToolMotion(Config()).place(samples.position[0])
    samples.object_position[0, 2] += 0.01
    assert judge(samples, header).outcome is ThrowOutcome.LANDED


def test_ball_that_leaves_a_still_spoon_is_dropped_with_the_evidence():
    """Only the left arm moves, and the ball leaves the right hand."""
    task = {"start": {**Config().task.start, "arm_left_4_joint": -1.9}, "end": {"arm_left_4_joint": -0.5}}
    config = Config(task=task)
    samples, header = episode(config)
    samples.object_linear_velocity[samples.stamps_ns < header.start_ns + RELEASE_S * 1e9] = 0.0
    result = judge(samples, header, config)
    assert result.outcome is ThrowOutcome.DROPPED
    assert result.reason.startswith("the spoon did not throw the ball: it left at 0.637 s with ")
    assert "and the spoon went that way at 0.00 m/s, not 0.20 m/s; until then, the spoon had moved by 0.0 mm" in (
        result.reason
    )
    assert result.reason.endswith(" J/kg of work on the ball")
    assert result.landing is not None


def test_ball_that_leaves_before_the_swing_is_dropped():
    assert judge(*episode(contacts=(("spoon", 0.0, 0.044),))).outcome is ThrowOutcome.DROPPED


def test_ball_that_leaves_against_the_swing_is_dropped():
    assert judge(*episode(velocity=-VELOCITY)).outcome is ThrowOutcome.DROPPED


def test_ball_that_leaves_at_rest_is_dropped():
    samples, header = episode(velocity=np.zeros(3))
    samples.velocity[:] = 0.0
    assert judge(samples, header).outcome is ThrowOutcome.DROPPED


def test_ball_that_rolls_on_over_the_rim_of_a_spoon_that_brakes_is_thrown():
    samples, header = episode()
    times = (samples.stamps_ns - header.start_ns) / 1e9
    for stop, outcome in ((RELEASE_S - 0.01, ThrowOutcome.LANDED), (RELEASE_S - 0.1, ThrowOutcome.DROPPED)):
        samples.velocity[times > stop] = 0.0
        assert judge(samples, header).outcome is outcome


def test_ball_that_is_thrown_downwards_is_thrown():
    """A ball that loses energy on the way down may still be thrown by the spoon."""
    start, end = dict(Config().task.start), dict(Config().task.end)
    config = Config(task={"start": {**start, **end}, "end": {joint: start[joint] for joint in end}})
    samples, header = episode(config)
    row = int(RELEASE_S * 250)
    down = ToolMotion(config).velocity(samples.position[row], samples.velocity[row])
    assert down[2] < -0.3
    samples, header = episode(config, velocity=down, origin=ORIGIN - [0.0, 0.0, 0.4])
    samples.object_position[0] = ORIGIN
    assert judge(samples, header, config).outcome is ThrowOutcome.LANDED


@pytest.mark.parametrize(("gap", "released_at"), [(0.0199, 0.65), (0.02, 0.6)])
def test_hop_shorter_than_the_gap_is_no_release(gap, released_at):
    result = judge(*episode(contacts=(("spoon", 0.0, 0.6), ("spoon", 0.6 + gap, 0.65))))
    assert result.release.time_s == pytest.approx(released_at, abs=1e-9)


def test_ball_back_in_the_spoon_is_recaught_at_its_first_release():
    result = judge(*episode(contacts=(HELD, ("spoon", 0.7, 0.72), ("spoon", 0.8, 0.81))))
    assert result.outcome is ThrowOutcome.RECAUGHT
    assert result.reason == "the spoon touched the ball again at 0.700 s"
    assert result.release.time_s == pytest.approx(RELEASE_S)
    assert result.recontacts == 2
    assert result.landing is not None


def test_ball_against_a_link_hits_the_robot():
    result = judge(*episode(contacts=(HELD, ("head_2_link", 0.7, 0.71), ("spoon", 0.8, 0.81))))
    assert (result.outcome, result.reason) == (ThrowOutcome.SELF_HIT, "the ball touched head_2_link at 0.700 s")
    assert result.recontacts == 2


def test_link_that_is_still_touched_after_the_release_is_hit():
    assert judge(*episode(contacts=(("arm_right_7_link", 0.6, 0.64), HELD))).outcome is ThrowOutcome.SELF_HIT
    assert judge(*episode(contacts=(("arm_right_7_link", 0.6, RELEASE_S), HELD))).outcome is ThrowOutcome.LANDED


def test_contacts_after_the_landing_do_not_count():
    contacts = (HELD, ("ground", landing_time(RADIUS), 1.38), ("leg_left_6_link", 1.39, None))
    assert judge(*episode(contacts=contacts)).outcome is ThrowOutcome.LANDED


def test_ball_that_does_not_come_down_in_time_is_a_timeout():
    result = judge(*episode(duration_s=1.2, end_reason="timeout"))
    assert result.outcome is ThrowOutcome.TIMEOUT
    assert result.reason == "the ball did not reach the landing plane; the trial ended as timeout"
    assert (result.landing, result.flight_time_s, result.hit_angle_rad) == (None, None, None)
    assert result.apex is not None


def test_ball_on_the_ground_below_the_plane_has_not_hit_the_robot():
    origin = np.array([0.0, 0.0, 1.2])
    config = Config(scene={"landing_height_m": 1.5})
    samples, header = episode(config, origin=origin, contacts=(HELD, ("ground", 1.1, None)), end_reason="rest")
    assert judge(samples, header, config).outcome is ThrowOutcome.TIMEOUT


@pytest.mark.parametrize("drag", [0.0, 0.47])
def test_impact_on_the_ground_does_not_bend_the_landing_just_above_it(drag):
    """The ball crosses a plane 5 mm above the ground and is stopped by the ground before the next sample."""
    config = Config(scene={"landing_height_m": 0.005}, ball={"drag_coefficient": drag})
    free, header = episode(config)
    end = int(np.argmax(free.object_position[:, 2] < 0.005 + RADIUS))
    step = 1 / config.sim.physics_hz
    path = ballistic_positions(
        free.object_position[end - 1], free.object_linear_velocity[end - 1], steps=2, config=config
    )
    free.object_position[end], free.object_linear_velocity[end] = path[2], (path[2] - path[1]) / step
    undisturbed = judge(free, header, config)
    free.object_position[end, 2], free.object_linear_velocity[end] = RADIUS, 0.0
    start_ns = int(free.stamps_ns[end]) - round(step * 1e9)
    impact = Contact("ground", start_ns, None)
    stopped = judge(free, replace(header, contacts=(*header.contacts, impact)), config)
    assert stopped.outcome is ThrowOutcome.LANDED
    assert stopped.landing.position == pytest.approx(undisturbed.landing.position, abs=1e-12)
    assert stopped.landing.velocity == pytest.approx(undisturbed.landing.velocity, abs=1e-9)
    assert judge(free, header, config).landing.time_s != pytest.approx(undisturbed.landing.time_s, abs=1e-5)


def test_crossing_the_landing_plane_upwards_is_no_landing():
    origin = np.array([0.0, 0.0, 0.9])
    config = Config(scene={"landing_height_m": 1.0})
    velocity = np.array([1.0, 0.0, 4.0])
    result = judge(*episode(config, duration_s=2.0, origin=origin, velocity=velocity), config)
    assert result.landing.time_s == pytest.approx(landing_time(1.0 + RADIUS, origin, velocity), abs=1e-9)
    assert result.landing.velocity[2] < 0


def test_saturated_effort_violates_a_limit_but_keeps_the_landing():
    samples, header = episode()
    samples.effort[100:110, ELBOW] = -joint_limits(TALOS).effort[ELBOW]
    result = judge(samples, header)
    assert result.outcome is ThrowOutcome.LIMIT_VIOLATED
    assert "arm_right_4_joint reached 1.000 of its effort limit" in result.reason
    assert result.landing is not None
    assert result.effort_saturated_share == pytest.approx(10 / 351)


def test_effort_limits_scale_with_the_robot():
    samples, header = episode()
    samples.effort[100, ELBOW] = joint_limits(TALOS).effort[ELBOW]
    result = judge(samples, header, Config(robot={"effort_scale": 2.0}))
    assert result.outcome is ThrowOutcome.LANDED
    assert (result.effort_peak.joint, result.effort_peak.share) == ("arm_right_4_joint", pytest.approx(0.5))


def test_speed_above_the_limit_of_any_joint_violates_it():
    samples, header = episode()
    samples.velocity[5, GRIPPER] = -1.2
    result = judge(samples, header)
    assert result.outcome is ThrowOutcome.LIMIT_VIOLATED
    assert result.reason == "gripper_left_joint moved at 1.200 of its velocity limit"


def test_moving_joint_beyond_its_range_violates_it():
    samples, header = episode()
    samples.position[5, ELBOW] = 0.05
    result = judge(samples, header)
    assert result.outcome is ThrowOutcome.LIMIT_VIOLATED
    assert result.reason.startswith("arm_right_4_joint left its range")
    assert result.tracking_error_rad["arm_right_4_joint"] == pytest.approx(0.05 + 1.9, abs=1e-3)


def test_held_joint_may_rest_beyond_the_end_of_its_range():
    samples, header = episode()
    samples.position[:, GRIPPER] = 1e-3
    assert judge(samples, header).outcome is ThrowOutcome.LANDED


@pytest.mark.parametrize(
    ("status", "outcome"), [(4, "landed"), (2, "landed"), (5, "tracking_failed"), (6, "tracking_failed")]
)
def test_goal_that_was_not_carried_out_is_a_tracking_failure(status, outcome):
    goal = GoalOutcome("arm_right_controller", status, -4, "path tolerance of arm_right_4_joint")
    result = judge(*episode(goals=(goal,)))
    assert result.outcome.value == outcome
    if result.outcome is ThrowOutcome.TRACKING_FAILED:
        assert result.reason.endswith("its goal: path tolerance of arm_right_4_joint")
        assert result.landing is not None


def test_tracking_error_is_that_of_each_moving_joint():
    samples, header = episode()
    samples.position[200, ELBOW] += 0.0125
    errors = judge(samples, header).tracking_error_rad
    assert errors["arm_right_4_joint"] == pytest.approx(0.0125)
    assert errors["arm_right_2_joint"] < 1e-12
    assert set(errors) == set(Config().task.end)


def test_outcomes_come_in_their_documented_order():
    samples, header = episode(contacts=(HELD, ("head_2_link", 0.7, 0.71)), duration_s=1.2, end_reason="rest")
    samples.effort[100, ELBOW] = 1e3
    assert judge(samples, header).outcome is ThrowOutcome.SELF_HIT
    later = header.contacts[1].start_ns
    header = replace(header, contacts=header.contacts[:1])
    assert judge(samples, header).outcome is ThrowOutcome.TIMEOUT
    still = replace(samples, velocity=0 * samples.velocity)
    assert judge(still, replace(header, contacts=(*header.contacts, Contact("head_2_link", later, None)))).outcome is (
        ThrowOutcome.DROPPED
    )
    lasting = (replace(header.contacts[0], end_ns=None),)
    assert judge(still, replace(header, contacts=lasting)).outcome is ThrowOutcome.NOT_RELEASED
    assert judge(samples, replace(header, contacts=())).outcome is ThrowOutcome.DROPPED
    goal = GoalOutcome("torso_controller", 6, -5, "")
    result = judge(samples, replace(header, contacts=(), goals=(goal,)))
    assert result.outcome is ThrowOutcome.TRACKING_FAILED
    assert result.reason == "torso_controller aborted its goal with error code -5"


@pytest.mark.parametrize("field", ["position", "velocity", "effort", "object_position", "object_linear_velocity"])
def test_diverged_simulation_is_a_tracking_failure_without_numbers(field):
    samples, header = episode()
    getattr(samples, field)[300, 0] = np.nan
    result = judge(samples, header)
    assert result.outcome is ThrowOutcome.TRACKING_FAILED
    assert result.landing is None
    assert result.velocity_peak is None


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["spoon", "head_2_link", "ground"]),
            st.floats(0, 1.4),
            st.one_of(st.none(), st.floats(0.001, 0.5)),
        ),
        max_size=5,
    )
)
def test_any_contacts_give_an_outcome_without_nan(contacts):
    spans = [(body, start, None if length is None else min(start + length, 1.4)) for body, start, length in contacts]
    result = judge(*episode(contacts=tuple(spans)))
    assert (result.reason is None) == (result.outcome is ThrowOutcome.LANDED)
    assert result.release is not None or result.outcome in (ThrowOutcome.NOT_RELEASED, ThrowOutcome.DROPPED)
    if result.release is not None:
        assert result.apex.position[2] >= result.release.position[2]
    for state in (result.release, result.apex, result.landing):
        if state is not None:
            assert all(math.isfinite(number) for number in np.hstack(astuple(state)))
