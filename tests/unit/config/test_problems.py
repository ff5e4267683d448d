"""A problem in a configuration is reported with its place, its value and what is expected."""

import pytest

from throwcollect.config.loader import load_locating_errors
from throwcollect.errors import PlanError, Problem


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("trails: 3", ["trails: unknown key; did you mean 'trials'?"]),
        ("ball: {mass_kg: .nan}", ["ball.mass_kg: should be a finite number, got nan"]),
        (
            "robot: {locked: torso_1_joint}",
            ["robot.locked: should be 'auto' or 'none', got 'torso_1_joint'; or should be a valid list, got"],
        ),
        (
            "trials: 1\nsweep: {parameters: {task.durations_s: {values: [1]}}}",
            ["sweep.parameters.task.durations_s: unknown key; did you mean 'task.duration_s'?"],
        ),
        ("record: {rate_hz: 300}", ["record.rate_hz: should divide sim.physics_hz, 500, got 300"]),
        *(
            (
                f"scene: {{bodies: {{{name}: {{shape: sphere, radius_m: 0.1, position_m: [9, 9, 9]}}}}}}",
                [f"scene.bodies.{name}: should have another name, as"],
            )
            for name in ("ball", "ground", "spoon", "talos")
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


@pytest.mark.parametrize(
    ("key", "where"),
    [
        ("trials", "run.yaml:1: "),
        ("record.topics.1", "run.yaml:7: "),
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
