from dataclasses import fields

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.engines.engine import BodyState
from throwcollect.errors import ConfigError
from throwcollect.robots.description import start_posture
from throwcollect.robots.talos import TALOS
from throwcollect.sim.world import World


def config(**sections):
    return Config.model_validate(sections)


CONFIG = config()


def motion(trial, moving, *, duration=1.0, seconds=4.0, **end):
    """Minimum-jerk commands at the end of each physics step, from the start posture to the task's end."""
    hz = trial.sim.physics_hz
    x = np.minimum(np.arange(1, round(seconds * hz) + 1) / hz / duration, 1) ** 1.2
    start, goal = (np.array([{**start_posture(trial), **angles}[j] for j in moving]) for angles in ({}, trial.task.end))
    for joint, angle in end.items():
        goal[moving.index(joint)] = angle
    return (start + (10 * x**3 - 15 * x**4 + 6 * x**5)[:, None] * (goal - start)).tolist()


def still(trial, world, steps):
    return [[start_posture(trial)[joint] for joint in world.moving]] * steps


def same(first, second):
    return all(np.array_equal(getattr(first, f.name), getattr(second, f.name)) for f in fields(first))


@pytest.fixture(scope="module", params=["bullet", "mujoco"])
def world(request):
    # A world keeps the engine with which it was made.
    made = World(config(sim={"engine": request.param}))
    yield made
    made.close()


def throw(world, trial=CONFIG, **motion_options):
    world.reset(trial)
    world.run(motion(trial, world.moving, **motion_options))
    return world.samples()


def test_the_first_sample_is_the_start_posture_with_the_ball_at_rest_in_the_spoon(world):
    world.reset(CONFIG, start_ns=17)
    start = world.samples()
    assert start.stamps_ns.tolist() == [17]
    assert start.position[0] == pytest.approx([start_posture(CONFIG)[joint] for joint in TALOS.joints], abs=1e-5)
    assert np.linalg.norm(start.object_linear_velocity[0]) < 1e-4
    assert world.contacts()[0].body == "spoon"
    assert world.contacts()[0].start_ns == 17
    # The elbow bears forearm, spoon and ball.
    assert start.effort[0, TALOS.joints.index("arm_right_4_joint")] == pytest.approx(11.0, abs=0.5)


def test_samples_are_evenly_spaced_in_simulated_time(world):
    world.reset(CONFIG, start_ns=10**9)
    assert world.run(motion(CONFIG, world.moving)[:100]) == 100
    assert world.samples().stamps_ns.tolist() == list(range(10**9, 10**9 + 200_000_001, 4_000_000))
    assert world.stamp_ns == 1_200_000_000
    assert world.steps == 100
    assert world.recorded == 51
    assert world.samples(3).stamps_ns[:2].tolist() == [1_012_000_000, 1_016_000_000]


def test_stamps_do_not_drift_when_the_period_is_no_whole_number_of_nanoseconds():
    trial = config(sim={"physics_hz": 240}, record={"rate_hz": 240})
    world = World(trial)
    world.run(still(trial, world, 240))
    assert world.samples().stamps_ns[[1, -1]].tolist() == [4_166_666, 10**9]
    world.close()


def test_locked_joints_stay_where_they_are_without_torque(world):
    samples = throw(world)
    locked = [column for column, joint in enumerate(TALOS.joints) if joint not in world.moving]
    posture = start_posture(CONFIG)
    assert (samples.position[:, locked] == [posture[TALOS.joints[column]] for column in locked]).all()
    assert not samples.velocity[:, locked].any()
    assert not samples.effort[:, locked].any()
    assert np.ptp(samples.position[:, TALOS.joints.index("arm_right_4_joint")]) > 1


def test_joints_are_at_the_command_at_the_end_of_each_step(world):
    world.reset(CONFIG)
    commands = motion(CONFIG, world.moving)
    for command in commands[:400]:
        world.run([command])
        assert world.joints()[0] == pytest.approx(command, abs=1e-4)


def test_a_throw_ends_with_the_first_sample_below_the_landing_plane(world):
    samples = throw(world)
    lowest = samples.object_position[:, 2] - CONFIG.ball.radius_m
    assert world.end_reason == "landed"
    assert (lowest[:-1] >= 0).all()
    assert lowest[-1] < 0
    assert world.run(motion(CONFIG, world.moving)) == 0


def test_the_ground_does_not_touch_a_ball_that_lands_at_height_zero(world):
    samples = throw(world)
    assert [contact.body for contact in world.contacts()] == ["spoon"]
    assert samples.object_linear_velocity[-1, 0] == samples.object_linear_velocity[-20, 0]


def test_a_raised_landing_plane_is_crossed_downwards_after_the_throw():
    trial = config(scene={"landing_height_m": 1.9})
    world = World(trial)
    lowest = throw(world, trial).object_position[:, 2] - trial.ball.radius_m
    assert lowest[0] < 1.9 < lowest.max()
    assert world.end_reason == "landed"
    assert lowest[-1] < 1.9 <= lowest[-2]
    world.close()


def test_a_ball_that_never_rises_above_the_landing_plane_comes_to_rest_on_the_ground():
    trial = config(scene={"landing_height_m": 1.9})
    world = World(trial)
    commands = motion(trial, world.moving, seconds=5)
    world.run(commands[:50])
    world.place("ball", BodyState((1.0, 0.0, 0.2)))
    world.run(commands[50:])
    assert world.end_reason == "rest"
    assert [contact.body for contact in world.contacts()] == ["spoon", "ground"]
    assert world.bodies["ball"].position[2] == pytest.approx(trial.ball.radius_m, abs=1e-3)
    world.close()


def test_a_ball_that_stays_in_the_spoon_is_at_rest_half_a_second_after_the_motion(world):
    samples = throw(world, duration=2.0, arm_right_4_joint=-1.85, arm_right_7_joint=-0.1)
    assert world.end_reason == "rest"
    assert 2.4 < samples.stamps_ns[-1] / 1e9 < 3.0
    assert world.contacts()[-1].end_ns is None


def test_waiting_for_the_motion_is_no_rest_and_ends_as_timeout():
    trial = config(sim={"max_trial_s": 1.5})
    world = World(trial)
    world.run(still(trial, world, 1000))
    assert world.end_reason == "timeout"
    assert world.stamp_ns == 1_500_000_000
    world.close()


def test_a_delay_of_whole_periods_shifts_the_commands(world):
    commands = motion(CONFIG, world.moving)
    start = [start_posture(CONFIG)[joint] for joint in world.moving]
    world.reset(CONFIG)
    world.run([start] * 5 + commands)
    shifted = world.samples()
    world.reset(config(sim={"command_delay_s": 0.01}))
    world.run(commands)
    assert same(world.samples(), shifted)


def test_a_delay_of_a_fraction_of_a_period_interpolates_the_commands(world):
    commands = motion(CONFIG, world.moving)
    start = [start_posture(CONFIG)[joint] for joint in world.moving]
    before = [start, *commands]
    world.reset(CONFIG)
    world.run(
        [[0.75 * a + 0.25 * b for a, b in zip(*pair, strict=True)] for pair in zip(commands, before, strict=False)]
    )
    shifted = world.samples()
    world.reset(config(sim={"command_delay_s": 0.0005}))
    world.run(commands)
    assert same(world.samples(), shifted)


def test_effort_scale_limits_the_effort_of_a_joint(world):
    weak = throw(world, config(robot={"effort_scale": 0.5}))
    elbow = TALOS.joints.index("arm_right_4_joint")
    assert np.abs(weak.effort[:, elbow]).max() == pytest.approx(17.86 / 2, rel=1e-9)


def test_the_ball_can_be_put_anywhere(world):
    world.reset(CONFIG)
    state = BodyState((1.0, 2.0, 3.0), (0.0, 0.6, 0.0, 0.8), (0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    world.place("ball", state)
    for name, value in vars(state).items():
        assert getattr(world.bodies["ball"], name) == pytest.approx(value, abs=1e-15)
    assert world.recorded == 1
    start = world.samples()
    assert start.object_position.tolist() == [[1, 2, 3]]
    assert start.object_angular_velocity[0] == pytest.approx((1, 2, 3), abs=1e-15)
    world.run(still(CONFIG, world, 2))
    assert world.contacts()[0].end_ns == 2_000_000
    assert world.bodies["ball"].linear_velocity == pytest.approx([0.1, 0.2, 0.3 - 9.81 * 0.004])


def test_a_ball_on_the_robot_touches_the_link_by_name(world):
    world.reset(CONFIG)
    world.place("ball", BodyState((0.0, 0.05, 2.2)))
    world.run(still(CONFIG, world, 300))
    assert "torso_2_link" not in world.moving
    assert {contact.body for contact in world.contacts()} >= {"spoon", "torso_1_link"}


def test_a_reset_with_another_posture_rebuilds_the_robot(world):
    world.reset(config(robot={"posture": {"torso_2_joint": 0.3}}))
    leaning = world.samples()
    world.reset(CONFIG)
    assert leaning.position[0, TALOS.joints.index("torso_2_joint")] == 0.3
    assert leaning.object_position[0, 0] - world.samples().object_position[0, 0] > 0.1


def test_a_claw_lets_go_at_the_time_of_each_trial_without_settling_anew(monkeypatch):
    trials = [config(tool={"name": "claw", "release_s": release_s}) for release_s in (0.5, 0.6)]
    world = World(trials[0])
    monkeypatch.setattr(world.engine, "rest", lambda *_: pytest.fail("settled anew"))
    for trial, end_ns in zip(trials, (502_000_000, 602_000_000), strict=True):
        throw(world, trial)
        held = world.contacts()[0]
        assert (held.body, held.start_ns, held.end_ns) == ("claw", 0, end_ns)
    world.close()


def test_a_trial_follows_one_whose_claw_has_no_room_for_the_ball(world):
    good = config(tool={"name": "claw"})
    expected = throw(world, good)
    with pytest.raises(ConfigError, match="has no room between the open fingers"):
        world.reset(config(tool={"name": "claw", "opening_m": 0.04}))
    assert same(throw(world, good), expected)
