from __future__ import annotations

import numpy as np
import pinocchio
import pytest

from throwcollect.config.schema import Config
from throwcollect.robots.clearance import MARGIN_M, Clearance
from throwcollect.robots.description import joint_model
from throwcollect.robots.dynamics import Dynamics
from throwcollect.robots.feasibility import Feasibility
from throwcollect.robots.robot import joint_limits
from throwcollect.robots.talos import TALOS
from throwcollect.robots.tools.tool import tool_of
from throwcollect.robots.trajectory import sample_quintic
from throwcollect.tasks.task import task_of

JOINTS = TALOS.joints
TASK = Config().task


def throw(end=None, start=None, duration_s=1.0, gamma=1.2, **sections):
    return Config(
        task={
            "start": {**TASK.start, **(start or {})},
            "end": {**TASK.end, **(end or {})},
            "duration_s": duration_s,
            "trajectory": {"gamma": gamma},
        },
        **sections,
    )


LONG = throw({"arm_right_4_joint": -0.2, "arm_right_7_joint": 0.55}, duration_s=0.95)


@pytest.fixture(scope="module")
def feasibility():
    return Feasibility(Config())


@pytest.fixture
def reason(feasibility):
    return lambda config: feasibility.check(config, task_of(config).trajectory())


def efforts_of(config, motion):
    dynamics = Dynamics(TALOS, joint_model(TALOS), {})
    efforts = dynamics.compute_efforts(config, tool_of(config), [array[:, dynamics.columns] for array in motion])
    return efforts[:, np.argsort(dynamics.columns)]


def shares(config):
    """Largest effort over limit, and speed over limit, of the moving joints."""
    times = np.linspace(0, config.task.duration_s, 501)
    trajectory = task_of(config).trajectory()
    columns = [JOINTS.index(joint) for joint in trajectory.joints]
    posture = np.array([{**TALOS.rest_posture, **config.robot.posture, **config.task.start}[joint] for joint in JOINTS])
    motion = tuple(np.tile(rest, (501, 1)) for rest in (posture, 0 * posture, 0 * posture))
    for array, sampled in zip(motion, sample_quintic(trajectory, times), strict=True):
        array[:, columns] = sampled
    efforts = np.abs(efforts_of(config, motion)) / joint_limits(TALOS).effort
    return efforts[:, columns].max(), (np.abs(motion[1]) / joint_limits(TALOS).velocity).max()


def test_the_default_throw_needs_the_effort_and_speed_measured_in_the_physics(reason):
    assert reason(Config()) is None
    # Measured in the physics: 0.86 and 0.69.
    assert shares(Config()) == pytest.approx((0.86, 0.69), abs=0.01)


def test_the_long_throw_is_refused_for_the_effort_that_saturated_in_the_physics(reason):
    assert reason(LONG).startswith("arm_right_2_joint needs 23.9")
    assert reason(LONG).endswith("its limit is 22.32 Nm")
    assert shares(LONG)[1] == pytest.approx(0.79, abs=0.01)


def test_a_position_beyond_the_limit_of_its_joint_is_refused(reason):
    assert reason(throw({"arm_right_7_joint": 0.75})) == (
        "arm_right_7_joint is at 0.75 rad at 1.000 s; its upper limit is 0.6981 rad"
    )
    assert "its lower limit is -2.88 rad" in reason(throw({"arm_right_2_joint": -2.9}))


def test_a_speed_above_the_limit_of_its_joint_is_refused(reason):
    assert reason(throw(duration_s=0.5)) == "arm_right_7_joint moves at 2.413 rad/s at 0.290 s; its limit is 1.76 rad/s"


@pytest.mark.parametrize(
    "change",
    [
        {"robot": {"effort_scale": 0.8}},
        {"tool": {"mass_kg": 0.6}},
        {"ball": {"mass_kg": 0.5}},
        {"scene": {"gravity_mps2": 15.0}},
    ],
)
def test_feasibility_depends_on_masses_gravity_and_effort_scale(reason, change):
    assert "Nm at" in reason(throw(**change))
    assert reason(Config()) is None


def test_the_effort_of_held_joints_is_limited_only_if_they_are_simulated(reason):
    """An overloaded arm does not matter as long as it is rigid and only the torso moves."""
    task = {"start": TASK.start, "end": {"torso_1_joint": 0.1}}
    assert reason(Config(task=task, tool={"mass_kg": 2.0})) is None
    assert reason(Config(task=task, tool={"mass_kg": 2.0}, robot={"locked": "none"})).startswith("arm_right_")


def test_the_static_torque_is_the_weight_times_its_lever():
    """Lifting one more kilogram in the cup by a joint's small turn takes the work that the torque gives."""
    heavy = Config(ball={"mass_kg": 1.045})
    posture = np.array([{**TALOS.rest_posture, **TASK.start}[joint] for joint in JOINTS])[None]
    still = np.zeros_like(posture)
    extra = [efforts_of(config, (posture, still, still))[0] for config in (heavy, Config())]
    column = JOINTS.index("arm_right_4_joint")
    model = pinocchio.buildModelFromUrdf(str(TALOS.urdf_path))
    data = model.createData()

    def height(turn):
        q = pinocchio.neutral(model)
        for joint, angle in zip(JOINTS, posture[0], strict=True):
            q[model.idx_qs[model.getJointId(joint)]] = angle
        q[model.idx_qs[model.getJointId("arm_right_4_joint")]] += turn
        pinocchio.framesForwardKinematics(model, data, q)
        gripper = data.oMf[model.getFrameId("gripper_right_base_link")]
        tool = tool_of(heavy)
        return gripper.act(tool.mount).act(np.array(tool.ball_seat(heavy.ball.radius_m)))[2]

    lever = (height(1e-5) - height(-1e-5)) / 2e-5
    assert (extra[0] - extra[1])[column] == pytest.approx(9.81 * lever, abs=1e-6)


def test_damping_and_inertia_show_in_the_torque():
    posture = np.array([{**TALOS.rest_posture, **TASK.start}[joint] for joint in JOINTS])[None]
    still, turning = np.zeros_like(posture), np.zeros_like(posture)
    column = JOINTS.index("torso_1_joint")
    turning[0, column] = 2.0
    rest = efforts_of(Config(), (posture, still, still))[0, column]
    # Turning steadily about the vertical torso axis takes friction alone.
    steady = efforts_of(Config(), (posture, turning, still))[0, column]
    assert steady - rest == pytest.approx(2.0 * joint_limits(TALOS).damping[column], abs=1e-9)
    faster = efforts_of(Config(), (posture, still, turning))[0, column]
    assert faster - rest > 1.0


def test_a_throw_that_brings_the_arm_against_the_head_is_refused(reason):
    config = throw(
        {"arm_right_2_joint": -2.15, "arm_right_3_joint": 1.95, "arm_right_5_joint": 2.33, "arm_right_6_joint": -1.19},
        duration_s=6.0,
        robot={"effort_scale": 2.0},
    )
    assert reason(config) == "arm_right_5_link and head_2_link overlap at 1.510 s; they must stay 2 mm apart"


def test_a_spoon_with_a_long_handle_hits_the_leg_and_one_with_a_short_does_not(reason):
    start = {joint: angle for joint, angle in TALOS.rest_posture.items() if joint.startswith("arm_right_")}
    task = {"start": start, "end": {**start, "arm_right_1_joint": 0.7, "arm_right_6_joint": 1.0}, "duration_s": 6.0}
    refusal = reason(Config(task=task))
    assert refusal.startswith("leg_left_3_link and spoon overlap at 5.")
    assert reason(Config(task=task, tool={"handle_length_m": 0.05})).startswith("task.start does not hold the ball")
    assert reason(Config(task=task)) == refusal


@pytest.mark.parametrize("joint", ["arm_left_4_joint", "head_1_joint", "arm_right_4_joint"])
def test_a_throw_that_does_not_move_the_spoon_is_refused(reason, joint):
    start = {**TASK.start, "arm_left_4_joint": -1.9, "head_1_joint": 0.0}
    end = {joint: start[joint] + (0.0 if "right" in joint else 0.3)}
    assert reason(Config(task={"start": start, "end": end})) == (
        "task.end moves no joint that carries the spoon; these do: torso_1_joint, torso_2_joint, arm_right_1_joint, "
        "arm_right_2_joint, arm_right_3_joint, arm_right_4_joint, arm_right_5_joint, arm_right_6_joint, "
        "arm_right_7_joint"
    )


def test_a_start_posture_that_does_not_hold_the_ball_is_refused(reason):
    assert reason(throw(start={"arm_right_5_joint": 1.5})) == (
        "task.start does not hold the ball: it tilts the spoon by 1.48 rad, so that the ball rolls out, 0.824 rad "
        "downwards; up to 0.594 rad, a tilt in any direction is safe"
    )
    assert reason(throw(start={"arm_right_5_joint": 0.55})) is None
    assert "task.start does not hold" in reason(throw(start={"arm_right_5_joint": 0.55}, tool={"cup_depth_m": 0.02}))
    half_sitting_arm = {"torso_1_joint": 0.0}
    assert "task.start does not hold" in reason(Config(task={"start": half_sitting_arm, "end": {"torso_1_joint": 0.3}}))


def test_a_posture_in_which_held_links_overlap_is_refused(reason):
    posture = {"arm_left_1_joint": 0.0, "arm_left_2_joint": 0.0, "arm_left_3_joint": 0.0, "arm_left_4_joint": 0.0}
    assert "leg_left_3_link" in reason(
        throw(robot={"posture": posture | {f"leg_left_{n}_joint": 0.0 for n in range(1, 7)}})
    )


def test_the_clearance_check_agrees_with_the_distances_of_all_pairs():
    """Every pair's distance, one by one, is the reference for the pruned check."""
    model = pinocchio.buildModelFromUrdf(str(TALOS.urdf_path))
    clearance = Clearance(TALOS, model, Config().tool)
    geometry = clearance.geometry
    data, shapes = model.createData(), geometry.createData()
    draw, limits = np.random.default_rng(1), joint_limits(TALOS)
    found = 0
    for _ in range(60):
        configuration = pinocchio.neutral(model)
        for joint in ("torso_1_joint", *(f"arm_right_{number}_joint" for number in range(1, 8))):
            column = JOINTS.index(joint)
            angle = draw.uniform(limits.lower[column], limits.upper[column])
            configuration[model.idx_qs[model.getJointId(joint)]] = angle
        pinocchio.computeDistances(model, data, geometry, shapes, configuration)
        closest = min(result.min_distance for result in shapes.distanceResults)
        approach = clearance.first_approach(configuration[None])
        assert (approach is not None) == (closest <= MARGIN_M)
        if approach is not None:
            found += 1
            assert approach.distance_m == pytest.approx(closest, abs=1e-5)
    assert found > 10


WALL = {"shape": "box", "size_m": [0.1, 2.0, 2.0], "position_m": [0.5, 0.0, 1.0]}


def draw_trial(draw, case):
    """Draw a trial; about half of them are feasible."""
    elbow, wrist, duration_s, gamma = draw.uniform([-0.6, 0.3, 0.85, 1.0], [-0.2, 0.72, 1.05, 1.3])
    end, start, sections = {"arm_right_4_joint": elbow, "arm_right_7_joint": wrist}, {}, {}
    if case == "world":
        sections["ball"] = {"mass_kg": draw.uniform(0.03, 0.1)}
        offsets = {"arm_right_7_joint": draw.uniform(-0.2, 0.2)}
        sections["robot"] = {
            "joint_offsets": offsets,
            "speed_scale": draw.uniform(0.6, 1.6),
            "effort_scale": draw.uniform(1.0, 3.0),
        }
    elif case == "collision":
        start["arm_right_7_joint"] = draw.uniform(-0.5, 0.3)
        angles = draw.uniform([-2.6, -1.5, 0.0, -0.6], [-2.1, 1.95, 2.33, 0.0])
        end |= {f"arm_right_{number}_joint": angle for number, angle in zip((2, 3, 5, 6), angles, strict=True)}
        duration_s *= 6
        sections["robot"] = {"effort_scale": 2.0}
    elif case == "wall":
        sections["scene"] = {"bodies": {"wall": WALL}}
        end["torso_1_joint"] = draw.uniform(-0.5, 0.5)
        duration_s *= 1.5
    elif case == "tool":
        sections["tool"] = {"handle_length_m": draw.choice([0.15, 0.3])}
    return throw(end, start, duration_s, gamma, **sections)


@pytest.mark.parametrize("case", ["limits", "world", "collision", "wall", "tool"])
def test_trials_that_are_found_feasible_together_are_accepted_one_by_one(case):
    draw, together, single = np.random.default_rng(3), Feasibility(Config()), Feasibility(Config())
    # A tool that no neighbour has is left to the check.
    configs = sorted((draw_trial(draw, case) for _ in range(60)), key=lambda config: config.tool.handle_length_m)
    trials = [(config, task_of(config).trajectory()) for config in configs]
    accepted = np.array([single.check(*trial) is None for trial in trials])
    sure = together.find_feasible(trials)
    assert not (sure & ~accepted).any()
    # Only what is closer to a limit than all ways to compute agree is left to the check.
    assert sure.sum() >= accepted.sum() - 2
    assert 0.1 < accepted.mean() < 0.9


def test_what_is_as_close_as_it_may_be_is_left_to_the_check():
    """The last joint of the arm goes a little beyond its limit, and in the second trial just to it."""
    limit = joint_limits(TALOS).upper[JOINTS.index("arm_right_7_joint")]
    trials = [throw({"arm_right_7_joint": end}, duration_s=1.5) for end in (limit + 9e-7, limit)]
    feasibility = Feasibility(Config())
    planned = [(config, task_of(config).trajectory()) for config in trials]
    assert [feasibility.check(*each) for each in planned] == [None, None]
    assert feasibility.find_feasible(planned).tolist() == [False, True]


def test_a_tool_that_rests_is_left_to_the_check(reason, feasibility):
    config = throw({joint: TASK.start[joint] for joint in TASK.end})
    assert reason(config).startswith("task.end moves no joint")
    assert not feasibility.find_feasible([(config, task_of(config).trajectory())] * 2).any()
