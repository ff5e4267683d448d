"""A problem in a configuration is reported with its place, its value and what is expected."""

from pathlib import Path

import pytest

from throwcollect.config.kinds import NAME_WORDS
from throwcollect.config.loader import load, load_locating_errors
from throwcollect.errors import ConfigError, PlanError, Problem

MEANT_TRIALS = ": unknown key; did you mean 'trials'?"
JOINT_LIST = "joint names, each with a number from -6.3 to 6.3 rad"


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("trails: 3", [f"run.yaml:1: trails{MEANT_TRIALS}"]),
        # A key under a misspelt name is not reported as missing too.
        ("trails: 3\nsweep: {parameters: {ball.mass_kg: {min: 1, max: 2}}}", [f"run.yaml:1: trails{MEANT_TRIALS}"]),
        ("until: {swung: 5}", ["run.yaml:1: until.swung: unknown key; known: landed"]),
        ("until: {landd: 5}", ["run.yaml:1: until.landd: unknown key; did you mean 'landed'?"]),
        ("run: {x: 3}", ["run.yaml:1: run.x: unknown key; docs/configuration.md lists all"]),
        (
            "task:\n  trajectory:\n    family: dmp\n    gamma: 1",
            [
                "run.yaml:4: task.trajectory.gamma: unknown key; known: "
                "family, basis_functions, weights, alpha_z and alpha_x"
            ],
        ),
        (
            "task: {trajectory: {family: dpm}}",
            ["run.yaml:1: task.trajectory.family: should be 'minimum_jerk' or 'dmp', got 'dpm'; did you mean 'dmp'?"],
        ),
        (
            "task: {trajectory: fast}",
            ["run.yaml:1: task.trajectory: should be keys and values or {family: …}, got 'fast'"],
        ),
        (
            "ball:\n  mass_kg: heavy",
            ["run.yaml:2: ball.mass_kg: should be a number above 0 and up to 2 kg, got 'heavy'"],
        ),
        ("ball:\n  mass_kg: '1'", ["run.yaml:2: ball.mass_kg: should be a number above 0 and up to 2 kg, got '1'"]),
        ("ball:\n  mass_kg: true", ["run.yaml:2: ball.mass_kg: should be a number above 0 and up to 2 kg, got true"]),
        ("ball:\n  mass_kg: .nan", ["run.yaml:2: ball.mass_kg: should be a number above 0 and up to 2 kg, got nan"]),
        ("ball:\n  mass_kg: 0", ["run.yaml:2: ball.mass_kg: should be a number above 0 and up to 2 kg, got 0"]),
        ("ball:\n  radius_m: [1]", ["run.yaml:2: ball.radius_m: should be a number from 0.005 to 0.1 m, got a list"]),
        *(
            (f"{key}:", [f"run.yaml:1: {key}: should be {words}, got nothing; write keys into it, or leave it out"])
            for key, words in (("ball", "keys and values"), ("sweep", "keys and values"))
        ),
        ("seed:", ["run.yaml:1: seed: should be a whole number from 0 to 4294967295, got nothing"]),
        (
            "sim: {physics_hz: 240.0}",
            ["run.yaml:1: sim.physics_hz: should be a whole number from 100 to 10000 Hz, got 240.0"],
        ),
        ("seed: -1", ["run.yaml:1: seed: should be a whole number from 0 to 4294967295, got -1"]),
        *(
            (
                f"sim: {{real_time_factor: {factor}}}",
                [f"run.yaml:1: sim.real_time_factor: should be a number from 0.001 to 1000 or null, got {factor}"],
            )
            for factor in ("1e-20", "0.0009", "1e+308")
        ),
        ("run: {trial_timeout_s: 0}", ["run.yaml:1: run.trial_timeout_s: should be a number above 0 s, got 0"]),
        (
            "name: Über",
            [f"run.yaml:1: name: should be {NAME_WORDS}, got 'Über'"],
        ),
        (
            "robot: {locked: torso_1_joint}",
            ["run.yaml:1: robot.locked: should be 'auto' or 'none' or a list of joint names, got 'torso_1_joint'"],
        ),
        (
            "robot: {locked: [torso_2_joint, torso_3_joint]}",
            [
                "run.yaml:1: robot.locked.1: Talos has no joint 'torso_3_joint'; "
                "did you mean 'torso_2_joint' or 'torso_1_joint'?"
            ],
        ),
        ("task:\n  end: [1]", [f"run.yaml:2: task.end: should be {JOINT_LIST}, got a list"]),
        (
            "task:\n  end:\n    arm_rihgt_4_joint: 1",
            [
                "run.yaml:3: task.end.arm_rihgt_4_joint: Talos has no joint 'arm_rihgt_4_joint'; "
                "did you mean 'arm_right_4_joint'?"
            ],
        ),
        (
            "robot: {posture: {knee: 1}}",
            [
                "run.yaml:1: robot.posture.knee: Talos has no joint 'knee'; known: arm_left_1_joint, arm_left_2_joint, "
                "arm_left_3_joint, arm_left_4_joint, arm_left_5_joint and 27 more"
            ],
        ),
        (
            "robot: {urdf: my.urdf}",
            [
                "run.yaml:1: robot.urdf: unknown key; docs/configuration.md lists all; "
                "CONTRIBUTING.md describes how to add a robot"
            ],
        ),
        (
            "tool: {name: gripper}",
            [
                "run.yaml:1: tool.name: should be 'spoon', got 'gripper'; no package that is installed brings it; "
                "CONTRIBUTING.md describes how to add one"
            ],
        ),
        (
            "sweep: {sampler: random}",
            [
                "run.yaml:1: sweep.sampler: should be one of 'grid', 'uniform', 'latin_hypercube', 'sobol', 'list', "
                "got 'random'; docs/configuration.md explains them"
            ],
        ),
        (
            "task:\n  end:\n    arm_right_4_joint: -60",
            [
                "run.yaml:3: task.end.arm_right_4_joint: should be a number from -6.3 to 6.3 rad, got -60; "
                "angles are in radians: -60 degrees are -1.0472"
            ],
        ),
        (
            "sim: {engine: auto}",
            [
                "run.yaml:1: sim.engine: should be one of 'bullet', 'mujoco', 'ballistic', got 'auto'; "
                "none is chosen automatically, as the same file would give other throws on another machine"
            ],
        ),
        (
            "task: {duration_s: 1,5}",
            [
                "run.yaml:1: task.5: unknown key; "
                "if it is the end of a number, decimals are written with a point, as in 1.5"
            ],
        ),
        ("task: {end: {}}", ["run.yaml:1: task.end: names no joint, so nothing would move"]),
        (
            "task: {end: {arm_left_1_joint: 0}}",
            ["run.yaml:1: task.end.arm_left_1_joint: start should name this joint, too"],
        ),
        (
            "record: {rate_hz: 300}",
            ["run.yaml:1: record.rate_hz: should divide sim.physics_hz, 500, got 300"],
        ),
        (
            "record: {topics: [joint_states]}",
            ["run.yaml:1: record.topics: should hold ball/odometry, from which throws are judged"],
        ),
        (
            "record: {topics: [joint_states, ball/odometry, clok]}",
            [
                "run.yaml:1: record.topics.2: should be one of 'joint_states', 'ball/odometry', 'controller_state', "
                "'tf', 'clock', got 'clok'; did you mean 'clock'?"
            ],
        ),
        (
            "robot: {locked: [torso_1_joint]}",
            ["run.yaml:1: robot.locked: should not hold joints that task.end moves, got torso_1_joint"],
        ),
        (
            "robot: {posture: {torso_1_joint: 0.1}}",
            ["run.yaml:1: robot.posture.torso_1_joint: should be left out, as task.start sets this joint"],
        ),
        (
            "tool: {cup_rim_radius_m: 0.003}",
            [
                "run.yaml:1: tool.cup_rim_radius_m: 0.003 m should be above cup_floor_radius_m, 0.004 m, "
                "or the cup holds no ball"
            ],
        ),
        (
            "task:\n  trajectory:\n    family: dmp\n    basis_functions: 2\n    weights: {torso_1_joint: [1, 2, 3]}",
            ["run.yaml:5: task.trajectory.weights.torso_1_joint: should be basis_functions = 2 numbers, got 3"],
        ),
        (
            "task:\n  trajectory:\n    family: dmp\n    basis_functions: 2\n    weights: {head_1_joint: [1, 2]}",
            ["run.yaml:5: task.trajectory.weights.head_1_joint: end does not name this joint, so it does not move"],
        ),
    ],
)
def test_a_wrong_value_is_reported_with_its_line_key_and_expectation(problems_of, text, messages):
    assert problems_of(text) == messages


def test_problems_are_reported_all_at_once_with_unknown_keys_first(problems_of):
    found = problems_of(
        """
        seed: x
        ball: {mass_kg: heavy, radius_m: 1}
        tool: {cup_rim_radius_m: 0.003}
        sim: {solver_iterations: 0}
        record: {rate_hz: 300}
        trails: 3
        robot: {locked: [torso_1_joint]}
        sweep:
          parameters:
            task.duraton_s: {min: 1, max: 2}
            ball.mass_kg: {min: -1, max: 1}
        """
    )
    assert [problem.split(": ")[1] for problem in found] == [
        "trails",
        "sweep.parameters.task.duraton_s",
        "seed",
        "ball.mass_kg",
        "ball.radius_m",
        "tool.cup_rim_radius_m",
        "sim.solver_iterations",
        "record.rate_hz",
        "robot.locked",
        "sweep.parameters.ball.mass_kg.min",
    ]


@pytest.mark.parametrize(
    ("text", "swept", "meant"),
    [
        ("task: {duration_s: 100}", "task.durations_s", "task.duration_s"),
        ("ball: {mass_kg: 0}", "ball.mas_kg", "ball.mass_kg"),
        ("ball: {mass_kg: 0}", "ball.mass_kgs", "ball.mass_kg"),
    ],
)
def test_a_misspelt_swept_key_is_reported_beside_a_wrong_value_of_the_right_key(problems_of, text, swept, meant):
    found = problems_of(f"trials: 1\n{text}\nsweep: {{parameters: {{{swept}: {{values: [1]}}}}}}")
    assert len(found) == 2
    assert found[0] == f"run.yaml:3: sweep.parameters.{swept}: unknown key; did you mean '{meant}'?"
    assert found[1].startswith(f"run.yaml:2: {meant}: should be ")


@pytest.mark.parametrize(
    "text",
    [
        "sim: {physics_hz: fast}\nrecord: {rate_hz: 300}",
        "task:\n  end: {arm_left_1_joint: 0}\n  start: {arm_left_1_joint: far}",
        "task: {end: {head_1_joint: far}}\nsweep: {parameters: {task.end.head_1_joint: {values: [0]}}}\ntrials: 1",
        "task: {trajectory: {family: dpm}}\n"
        "sweep: {parameters: {task.trajectory.weights.torso_1_joint.0: {values: [0]}}}\ntrials: 1",
        "sweep: {sampler: lost, parameters: {ball.mass_kg: {min: 1, max: 2, count: 3}}}\ntrials: 1",
    ],
)
def test_a_single_wrong_value_causes_only_one_problem(problems_of, text):
    assert len(problems_of(text)) == 1


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
        ("sweep.parameters.task.duration_s", "run.yaml:4: "),
        ("record.topics.1", "run.yaml:7: "),
        ("ball.mass_kg", "run.yaml: "),
        ("run.router_port", ""),
        ("sweep", "run.yaml:2: "),
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


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("unknown_{}: 1\n", "unknown_0: unknown key; docs/configuration.md lists all"),
        ("name: a\n", "name: the key is here twice, first in line 1"),
    ],
)
def test_only_twenty_of_many_problems_are_listed_and_the_rest_are_counted(line, message, tmp_path):
    path = tmp_path / "many.yaml"
    path.write_text("name: a\n" + "".join(line.format(number) for number in range(500)))
    with pytest.raises(ConfigError) as caught:
        load(path)
    lines = str(caught.value).splitlines()
    assert len(lines) == 21
    assert lines[0].startswith(f"{path}:2: {message}")
    assert lines[-1] == "and 480 more"


def test_suggestions_are_searched_only_for_the_first_of_many_problems(tmp_path, monkeypatch):
    asked = []

    def near(word, known, count):
        asked.append(word)
        return []

    monkeypatch.setattr("throwcollect.wording.get_close_matches", near)
    path = tmp_path / "many.yaml"
    path.write_text("task: {end: {" + ", ".join(f"joint_{number}: 1" for number in range(500)) + "}}\n")
    with pytest.raises(ConfigError, match=r"task\.end\.joint_0: Talos has no joint 'joint_0'; known: "):
        load(path)
    assert len(set(asked)) == 200


@pytest.mark.parametrize(
    ("parameters", "keys"),
    [
        ("{task: {end: {arm_right_4_joint: {min: -0.9, max: -0.3}}}}", ["task.end.arm_right_4_joint"]),
        ("{task.end: {arm_right_4_joint: {values: [-0.9]}}}", ["task.end.arm_right_4_joint"]),
        ("{task: {duration_s: [1.0, 1.2], end: {torso_1_joint: 0.1}}}", ["task.duration_s", "task.end.torso_1_joint"]),
        ("{ball: {mass_kg: {min: 0.1, mx: 0.2}}, task.duration_s: {values: [1]}}", ["ball.mass_kg"]),
    ],
)
def test_swept_keys_in_sections_are_reported_as_keys_with_dots(problems_of, parameters, keys):
    found = problems_of(f"trials: 1\nsweep: {{parameters: {parameters}}}")
    assert found == [f"run.yaml:2: sweep.parameters.{key}: write {key} as one key" for key in keys]


@pytest.mark.parametrize(
    ("text", "key", "advice"),
    [
        ("task: {end: {arm_right_4_joint: -28deg}}", "task.end.arm_right_4_joint", "-28 degrees are -0.4887"),
        ("task: {end: {arm_right_4_joint: 45°}}", "task.end.arm_right_4_joint", "45 degrees are 0.7854"),
        ("task: {end: {arm_right_4_joint: -0.5 rad}}", "task.end.arm_right_4_joint", "write the number alone, in rad"),
        ("ball: {mass_kg: 40 g}", "ball.mass_kg", "write the number alone, in kg"),
        ("task: {duration_s: '1,2'}", "task.duration_s", "decimals are written with a point, as in 1.5"),
        *(
            (
                f"trials: 1\nsweep: {{parameters: {{{key}: {{min: {text}, max: 9}}}}}}",
                f"sweep.parameters.{key}.min",
                advice,
            )
            for key, text, advice in (
                ("task.end.arm_right_4_joint", "-28 deg", "angles are in radians: -28 degrees are -0.4887"),
                ("task.duration_s", "1.0 s", "write the number alone, in s"),
            )
        ),
    ],
)
def test_a_number_with_a_unit_or_a_decimal_comma_is_reported_with_how_it_is_written(problems_of, text, key, advice):
    (found,) = problems_of(text)
    assert f": {key}: should be a number" in found
    assert found.endswith(advice)


@pytest.mark.parametrize(
    "text",
    [
        *(
            f"task: {{end: {{arm_right_4_joint: {text}}}}}"
            for text in ("x", "'1'", "1.2.3", "2024-01-01", "true", ".nan")
        ),
        "sweep: {parameters: {task.end.arm_right_4_joint: {min: 0, max: 1, count: 2.5}}}",
    ],
)
def test_a_value_that_is_no_number_with_a_unit_gets_no_advice(problems_of, text):
    (found,) = problems_of(f"trials: 1\n{text}")
    assert ";" not in found


def test_a_value_that_cannot_be_read_is_reported_once(problems_of):
    assert problems_of("seed: !!int x\nball: {mass_kg: !!bool maybe}") == [
        "run.yaml:1: seed: 'x' is not of the kind int",
        "run.yaml:2: ball.mass_kg: 'maybe' is not of the kind bool",
    ]
