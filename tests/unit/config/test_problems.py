"""A problem in a configuration is reported with its place, its value and what is expected."""

from pathlib import Path

import pytest

from throwcollect.config.loader import load, load_locating_errors
from throwcollect.errors import ConfigError, PlanError, Problem


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("trails: 3", ["trails: unknown key; did you mean 'trials'?"]),
        ("robot: {urdf: my.urdf}", ["robot.flange: missing"]),
        (
            "task: {trajectory: {family: dmp, gamma: 1}}",
            ["task.trajectory.gamma: unknown key; known: family, basis_functions, weights, alpha_z, alpha_x and"],
        ),
        ("ball: {mass_kg: heavy}", ["ball.mass_kg: should be a valid number, got 'heavy'"]),
        ("ball: {mass_kg: .nan}", ["ball.mass_kg: should be a finite number, got nan"]),
        ("ball: {mass_kg: 0}", ["ball.mass_kg: should be greater than 0, got 0"]),
        ("ball:", ["ball: should be keys and values, got None"]),
        (
            "task: {trajectory: {family: dpm}}",
            ["task.trajectory.family: should be 'minimum_jerk', 'dmp' or 'file', got 'dpm'; did you mean 'dmp'?"],
        ),
        (
            "robot: {locked: torso_1_joint}",
            ["robot.locked: should be 'auto' or 'none', got 'torso_1_joint'; or should be a valid list, got"],
        ),
        (
            "record: {topics: [joint_states, ball/odometry, clok]}",
            ["record.topics.2: should be 'joint_states', 'ball/odometry', 'controller_state', 'tf' or 'clock', got"],
        ),
        (
            "task: {end: {arm_rihgt_4_joint: 1}}",
            ["task.end.arm_rihgt_4_joint: Talos has no joint 'arm_rihgt_4_joint'; did you mean 'arm_right_4_joint'?"],
        ),
        (
            "task: {start: {torso_1_jont: 0}, end: {torso_1_joint: 1}}",
            ["task.start.torso_1_jont: Talos has no joint 'torso_1_jont'; did you mean 'torso_1_joint'?"],
        ),
        (
            "trials: 1\nsweep: {parameters: {task.durations_s: {values: [1]}}}",
            ["sweep.parameters.task.durations_s: unknown key; did you mean 'task.duration_s'?"],
        ),
        (
            "sweep: {parameters: {ball.mass_kg: {min: 1, max: 2}}}",
            ["trials: missing; the sampler sobol should know how many trials to draw"],
        ),
        ("task: {end: {}}", ["task.end: names no joint, so nothing would move"]),
        ("task: {end: {arm_left_1_joint: 0}}", ["task.end.arm_left_1_joint: start should name this joint, too"]),
        ("record: {rate_hz: 300}", ["record.rate_hz: should divide sim.physics_hz, 500, got 300"]),
        ("record: {topics: [joint_states]}", ["record.topics: should hold ball/odometry, from which throws are"]),
        ("robot: {locked: [torso_1_joint]}", ["robot.locked: should not hold joints that task.end moves, got torso"]),
        ("robot: {posture: {torso_1_joint: 0.1}}", ["robot.posture.torso_1_joint: should be left out, as task.start"]),
        *(
            (
                f"scene: {{bodies: {{{name}: {{shape: sphere, radius_m: 0.1, position_m: [9, 9, 9]}}}}}}",
                [f"scene.bodies.{name}: should have another name, as"],
            )
            for name in ("ball", "ground", "spoon", "talos")
        ),
        ("tool: {cup_rim_radius_m: 0.003}", ["tool.cup_rim_radius_m: 0.003 m should be above cup_floor_radius_m"]),
        (
            "task: {trajectory: {family: dmp, basis_functions: 2, weights: {torso_1_joint: [1, 2, 3]}}}",
            ["task.trajectory.weights.torso_1_joint: should be basis_functions = 2 numbers, got 3"],
        ),
    ],
)
def test_a_wrong_key_or_value_is_reported_with_key_value_and_expectation(problems_of, text, messages):
    found = [problem.partition(": ")[2] for problem in problems_of(text)]
    assert len(found) == len(messages)
    assert all(problem.startswith(message) for problem, message in zip(found, messages, strict=True)), found


def test_all_problems_are_reported_at_once_in_the_order_of_their_lines(problems_of):
    found = problems_of(
        """
        seed: x
        ball: {mass_kg: heavy, radius_m: 1}
        tool: {cup_rim_radius_m: 0.003}
        trails: 3
        sweep: {parameters: {ball.mass_kg: {mn: 1, max: 2}}}
        """
    )
    assert [problem.split(": ")[:2] for problem in found] == [
        ["run.yaml:1", "seed"],
        ["run.yaml:2", "ball.mass_kg"],
        ["run.yaml:2", "ball.radius_m"],
        ["run.yaml:3", "tool.cup_rim_radius_m"],
        ["run.yaml:4", "trails"],
        ["run.yaml:5", "sweep.parameters.ball.mass_kg.min"],
        ["run.yaml:5", "sweep.parameters.ball.mass_kg.mn"],
    ]


def test_a_problem_has_its_file_line_and_key_as_fields(write):
    path = write("name: x\nball:\n  mass_kg: heavy")
    with pytest.raises(ConfigError, match="heavy") as caught:
        load(path)
    problem = caught.value.problems[0]
    assert (problem.path, problem.line, problem.key) == (path, 3, "ball.mass_kg")


@pytest.mark.parametrize(
    ("key", "where"),
    [
        ("trials", "run.yaml:1: "),
        ("sweep.parameters.task.duration_s.max", "run.yaml:4: "),
        ("record.topics.1", "run.yaml:7: "),
        ("ball.mass_kg", "run.yaml: "),
        ("run.router_port", ""),
    ],
)
def test_an_error_raised_after_loading_gets_the_line_of_its_key(write, key, where):
    path = write("""
        trials: 3
        sweep:
          parameters:
            task.duration_s: {min: 1, max: 2}
        record:
          topics: [joint_states,
                   ball/odometry]
        """)
    found = PlanError([Problem("all too fast", key)], expected="slower ones", hint="slow down")
    with pytest.raises(PlanError, match="all too fast") as caught, load_locating_errors(path, ["run.router_port=7447"]):
        raise found
    assert caught.value.message.replace(f"{path.parent}/", "") == f"{where}{key}: all too fast"
    assert (caught.value.expected, caught.value.hint) == (found.expected, found.hint)


@pytest.mark.parametrize("problem", [Problem("torn", "trials", Path("list.csv"), 8), Problem("torn")])
def test_an_error_about_another_file_or_without_a_key_keeps_its_place(write, problem):
    with pytest.raises(ConfigError, match="torn") as caught, load_locating_errors(write("trials: 3")):
        raise ConfigError([problem])
    assert caught.value.problems == [problem]
