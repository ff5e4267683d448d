import re
import textwrap
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from throwcollect.config.loader import dump_yaml, load, load_locating_errors
from throwcollect.config.schema import (
    BallConfig,
    Config,
    DynamicMovementPrimitive,
    MinimumJerk,
    Range,
    SweepConfig,
    Values,
)
from throwcollect.errors import ConfigError, PlanError, Problem
from throwcollect.tasks.throw.config import ThrowConfig

CONFIGS = Path(__file__).parents[3] / "configs"
KNOWN_IN_RUN = (
    "simulations, runtime, router_port, open, ros, root_namespace, domain_id, trial_timeout_s, start_timeout_s, "
    "grace_s, retries, replay, restarts"
)
JOINT_LIST = "joint names, each with a number from -6.3 to 6.3 rad"


@pytest.fixture
def write(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / "run.yaml"
        path.write_text(textwrap.dedent(text).lstrip("\n"))
        return path

    return write


@pytest.fixture
def problems_of(write):
    """Messages of all problems of a file, without the directory that it is in."""

    def problems_of(text: str, *overrides: str) -> list[str]:
        path = write(text)
        with pytest.raises(ConfigError, match=r"\S") as caught:
            load(path, overrides)
        return [str(problem).replace(f"{path.parent}/", "") for problem in caught.value.problems]

    return problems_of


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.name)
def test_ready_configurations_load(path):
    config = load(path)
    assert config.name == path.stem


def test_what_is_left_out_has_its_default(write):
    assert load(write("name: short")) == Config(name="short")


def test_the_family_of_a_trajectory_may_be_left_out(write):
    assert load(write("task: {trajectory: {gamma: 1.1}}")).task.trajectory == MinimumJerk(gamma=1.1)


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("trails: 3", ["run.yaml:1: trails: unknown key; did you mean 'trials'?"]),
        ("run: {x: 3}", [f"run.yaml:1: run.x: unknown key; known keys here: {KNOWN_IN_RUN}"]),
        (
            "task:\n  trajectory:\n    family: dmp\n    gamma: 1",
            [
                "run.yaml:4: task.trajectory.gamma: unknown key; known keys here: "
                "family, basis_functions, weights, alpha_z, alpha_x"
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
        ("ball:", ["run.yaml:1: ball: should be keys and values, got nothing"]),
        (
            "sim: {physics_hz: 240.0}",
            ["run.yaml:1: sim.physics_hz: should be a whole number from 100 to 10000 Hz, got 240.0"],
        ),
        ("seed: -1", ["run.yaml:1: seed: should be a whole number from 0 to 4294967295, got -1"]),
        ("run: {trial_timeout_s: 0}", ["run.yaml:1: run.trial_timeout_s: should be a number above 0 s, got 0"]),
        (
            "name: Über",
            ["run.yaml:1: name: should be lower-case letters, digits, - and _, first a letter or digit, got 'Über'"],
        ),
        (
            "robot: {locked: torso_1_joint}",
            ["run.yaml:1: robot.locked: should be 'auto' or 'none' or a list of joint names, got 'torso_1_joint'"],
        ),
        (
            "robot: {locked: [torso_2_joint, torso_3_joint]}",
            ["run.yaml:1: robot.locked.1: Talos has no joint 'torso_3_joint'; did you mean 'torso_2_joint'?"],
        ),
        ("task:\n  end: [1]", [f"run.yaml:2: task.end: should be {JOINT_LIST}, got a list"]),
        (
            "task:\n  end:\n    arm_rihgt_4_joint: 1",
            [
                "run.yaml:3: task.end.arm_rihgt_4_joint: Talos has no joint 'arm_rihgt_4_joint'; "
                "did you mean 'arm_right_4_joint'?"
            ],
        ),
        ("robot: {posture: {knee: 1}}", ["run.yaml:1: robot.posture.knee: Talos has no joint 'knee'"]),
        (
            "task:\n  end:\n    arm_right_4_joint: -60",
            [
                "run.yaml:3: task.end.arm_right_4_joint: should be a number from -6.3 to 6.3 rad, got -60; "
                "angles are in radians: -60 degrees are -1.0472"
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
def test_wrong_values_are_named_with_place_and_expectation(problems_of, text, messages):
    assert problems_of(text) == messages


@pytest.mark.parametrize(
    ("sweep", "messages"),
    [
        ("task.duraton_s: {min: 1, max: 2}", ["task.duraton_s: unknown key; did you mean 'task.duration_s'?"]),
        ("sim.physics_hz: {values: [500]}", ["sim.physics_hz: cannot vary from trial to trial"]),
        ("task.points_hz: {values: [50]}", ["task.points_hz: cannot vary from trial to trial"]),
        ("task.trajectory.family: {values: [5]}", ["task.trajectory.family: cannot be swept, as it is not a number"]),
        (
            "task.start.arm_right_3_joint: {min: -1, max: -0.9}",
            [
                "task.start.arm_right_3_joint: cannot vary from trial to trial, "
                "as task.end does not name arm_right_3_joint"
            ],
        ),
        ("task.duration_s: 1", ["task.duration_s: should be {min: …, max: …} or {values: …}, got 1"]),
        ("task.duration_s: {min: 1}", ["task.duration_s.max: missing; should be a number in s"]),
        ("task.duration_s: {min: 1, mx: 2}", ["task.duration_s.mx: unknown key; did you mean 'max'?"]),
        ("task.duration_s: {min: 2, max: 1}", ["task.duration_s.min: should be at most max, 1.0, got 2.0"]),
        (
            "task.duration_s: {values: []}",
            ["task.duration_s.values: should be a list of numbers in s, got an empty list"],
        ),
        (
            "ball.drag_coefficient: {min: 0, max: 1, scale: log}",
            ["ball.drag_coefficient.min: should be above 0 on a logarithmic scale, got 0.0"],
        ),
        (
            "task.duration_s: {min: 0, max: 2}",
            ["task.duration_s.min: should be a number from 0.1 to 10 s, got 0.0"],
        ),
        (
            "ball.friction: {values: [1, 3]}",
            ["ball.friction.values.1: should be a number from 0 to 2, got 3.0"],
        ),
        (
            "task.end.arm_right_4_joint: {min: -60, max: 0}",
            [
                "task.end.arm_right_4_joint.min: should be a number from -6.3 to 6.3 rad, got -60.0; "
                "angles are in radians: -60 degrees are -1.0472"
            ],
        ),
        (
            "task.duration_s: {min: 1, max: 2, count: 2}",
            ["task.duration_s.count: should be left out, as the sampler sobol has no grid"],
        ),
    ],
)
def test_wrong_sweeps_are_named_with_place_and_expectation(problems_of, sweep, messages):
    text = f"trials: 1\nsweep:\n  parameters:\n    {sweep}"
    assert problems_of(text) == [f"run.yaml:4: sweep.parameters.{message}" for message in messages]


@pytest.mark.parametrize(
    ("sweep", "message"),
    [
        (
            "{sampler: sobel}",
            "sweep.sampler: should be one of 'grid', 'uniform', 'latin_hypercube', 'sobol', 'list', "
            "got 'sobel'; did you mean 'sobol'?",
        ),
        ("{sampler: list}", "sweep.file: missing; the sampler list should have a CSV or Parquet file"),
        ("{file: a.csv}", "sweep.file: should be left out, as the sampler sobol reads no file"),
        (
            "{sampler: list, file: a.csv, parameters: {ball.mass_kg: {values: [1]}}}",
            "sweep.parameters: should be left out, as the sampler list takes keys and values from its file",
        ),
        (
            "{sampler: grid, parameters: {ball.mass_kg: {min: 1, max: 2}}}",
            "sweep.parameters.ball.mass_kg.count: missing; the sampler grid should know how many points to take",
        ),
        (
            "{sampler: grid, parameters: {ball.mass_kg: {min: 1, max: 2, count: 1}}}",
            "sweep.parameters.ball.mass_kg.count: should be 2 or more, as both min and max are grid points",
        ),
    ],
)
def test_samplers_get_what_they_need_and_nothing_else(problems_of, sweep, message):
    assert problems_of(f"trials: 1\nsweep: {sweep}") == [f"run.yaml:2: {message}"]


def test_samplers_that_draw_need_a_number_of_trials(problems_of):
    assert problems_of("sweep: {parameters: {ball.mass_kg: {min: 1, max: 2}}}") == [
        "run.yaml: trials: missing; the sampler sobol should know how many trials to draw, or until how many have "
        "landed"
    ]


def test_all_problems_are_reported_at_once_and_unknown_keys_first(problems_of):
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
        "trials",
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
def test_a_misspelt_swept_key_is_found_beside_a_wrong_value_of_the_right_one(problems_of, text, swept, meant):
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
def test_a_default_in_the_place_of_a_wrong_value_causes_no_further_problems(problems_of, text):
    assert len(problems_of(text)) == 1


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "run.yaml: the file is empty"),
        (b"# only a comment\n", "run.yaml: the file is empty"),
        (b"- 1\n", "run.yaml:1: the file should hold keys and values"),
        (b"a: 1\nb: \xff\n", "run.yaml:2: should be UTF-8 text, got the byte 0xff"),
        (
            b"a: 1\nb: [1, 2\nc: 3\n",
            "run.yaml:3: not valid YAML: expected ',' or ']', but got ':', while parsing a flow sequence",
        ),
        (
            b"a: 1\n\tb: 2\n",
            "run.yaml:2: not valid YAML: found character '\\t' that cannot start any token, "
            "while scanning for the next token",
        ),
        (
            b"a: 1\n---\nb: 2\n",
            "run.yaml:2: not valid YAML: but found another document, expected a single document in the stream",
        ),
        (b"a: " + 600 * b"[", "run.yaml:1: not valid YAML: values are nested too deeply"),
        (b"name: " + 5_000_000 * b"x", "run.yaml: larger than 5000000 bytes"),
    ],
)
def test_files_that_are_no_configuration(tmp_path, content, message):
    path = tmp_path / "run.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=re.escape(f"{tmp_path}/{message}")) as caught:
        load(path)
    assert [str(problem) for problem in caught.value.problems] == [f"{tmp_path}/{message}"]


def test_files_that_cannot_be_read(tmp_path, monkeypatch):
    with pytest.raises(ConfigError, match=r"missing\.yaml: no such file$"):
        load(tmp_path / "missing.yaml")
    with pytest.raises(ConfigError, match=r"should be a YAML file, got a directory$"):
        load(tmp_path)
    forbidden = tmp_path / "forbidden.yaml"
    forbidden.write_text("name: secret")
    # Root may read everything, so the refusal is played where the file is opened.
    monkeypatch.setattr(Path, "open", _refuse)
    with pytest.raises(ConfigError, match=r"no permission to read the file$"):
        load(forbidden)


def _refuse(path, *_):
    raise PermissionError(13, "Permission denied", str(path))


def test_overrides_win_over_the_file_and_later_ones_over_earlier_ones(write):
    path = write("trials: 3\nball: {mass_kg: 0.1}\nsweep: {parameters: {ball.mass_kg: {min: 0.1, max: 0.2}}}")
    config = load(
        path,
        [
            "ball.mass_kg=0.2",
            "ball.mass_kg=0.3",
            "task.end={arm_right_4_joint: -0.5}",
            "sweep.parameters.ball.mass_kg.max=0.4",
            "sweep.parameters.task.duration_s={values: [1.0, 1.2]}",
            "sweep.parameters.task.duration_s.values.1=1.5",
            "run.simulations = 4",
        ],
    )
    assert config.ball.mass_kg == 0.3
    assert config.task.end == {"arm_right_4_joint": -0.5}
    assert config.sweep.parameters == {
        "ball.mass_kg": Range(min=0.1, max=0.4),
        "task.duration_s": Values(values=[1, 1.5]),
    }
    assert config.run.simulations == 4


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("trials", "an override should be KEY=VALUE, got 'trials'"),
        ("=3", "an override should be KEY=VALUE, got '=3'"),
        ("ball..mass_kg=3", "an override should be KEY=VALUE, got 'ball..mass_kg=3'"),
        (
            "ball.mass_kg=[",
            "ball.mass_kg: not valid YAML: expected the node content, but found '<stream end>', "
            "while parsing a flow node; got '['",
        ),
        ("ball.mass_kg=heavy", "ball.mass_kg: should be a number above 0 and up to 2 kg, got 'heavy'"),
        ("ball.mas_kg=1", "ball.mas_kg: unknown key; did you mean 'mass_kg'?"),
        ("bal.mass_kg=1", "bal: unknown key; did you mean 'ball'?"),
        ("ball.mass_kg.x=1", "ball.mass_kg.x: nothing of this name can be set; got '1'"),
        ("record.topics.7=tf", "record.topics.7: nothing of this name can be set; got 'tf'"),
        ("record.topics.last=tf", "record.topics.last: nothing of this name can be set; got 'tf'"),
    ],
)
def test_wrong_overrides_are_named_without_a_line_of_the_file(problems_of, override, message):
    file = "ball: {mass_kg: 0.1}\nrecord: {topics: [joint_states, ball/odometry]}"
    assert problems_of(file, override) == [message]


def test_problems_carry_their_facts_as_fields(write):
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
def test_what_is_found_later_is_named_with_the_place_of_its_key(write, key, where):
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
def test_what_has_another_place_or_none_keeps_it(write, problem):
    with pytest.raises(ConfigError, match="torn") as caught, load_locating_errors(write("trials: 3")):
        raise ConfigError([problem])
    assert caught.value.problems == [problem]


angles = st.floats(-6.3, 6.3)
weights = st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3)
configs = st.builds(
    Config,
    name=st.from_regex(r"[a-z0-9][a-z0-9_-]{0,20}", fullmatch=True),
    seed=st.integers(0, 2**32 - 1),
    trials=st.integers(1, 10**7),
    ball=st.builds(
        BallConfig, mass_kg=st.floats(0, 2, exclude_min=True), friction=st.floats(0, 2), radius_m=st.floats(0.005, 0.1)
    ),
    task=st.builds(
        ThrowConfig,
        end=st.dictionaries(st.sampled_from(["torso_1_joint", "arm_right_4_joint"]), angles, min_size=2),
        trajectory=st.one_of(
            st.builds(MinimumJerk, gamma=st.floats(1, 2)),
            st.builds(
                DynamicMovementPrimitive,
                family=st.just("dmp"),
                basis_functions=st.just(3),
                weights=st.fixed_dictionaries({"arm_right_4_joint": weights}),
                alpha_z=st.floats(0, exclude_min=True, allow_infinity=False),
            ),
        ),
    ),
    sweep=st.one_of(
        st.builds(
            SweepConfig,
            parameters=st.dictionaries(
                st.sampled_from(["ball.restitution", "scene.spoon_friction"]),
                st.one_of(
                    st.builds(
                        Range, min=st.floats(1e-9, 0.5), max=st.floats(0.5, 1), scale=st.sampled_from(["linear", "log"])
                    ),
                    st.builds(Values, values=st.lists(st.floats(0, 1), min_size=1)),
                ),
            ),
        ),
        st.builds(SweepConfig, sampler=st.just("list"), file=st.text()),
    ),
)


@settings(deadline=None, max_examples=60)
@given(config=configs)
def test_resolved_text_loads_back_to_an_equal_configuration(tmp_path_factory, config):
    path = tmp_path_factory.getbasetemp() / "resolved.yaml"
    path.write_text(dump_yaml(config), encoding="utf-8", newline="")
    loaded = load(path)
    assert loaded == config
    assert dump_yaml(loaded) == dump_yaml(config)


def test_resolved_text_shows_every_key():
    lines = dump_yaml(Config()).splitlines()
    assert "  mass_kg: 0.045" in lines
    assert "  topics: [joint_states, ball/odometry]" in lines
    assert "trials: null" in lines
    assert dump_yaml(Config(name="on")).startswith('name: "on"\n')


PARAMETERS = "parameters: {task.duration_s: {min: 1, max: 1.2}}"


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("{}", "distance_m: missing; at least one of distance_m, height_m and hit_angle_rad should be there"),
        ("{distance_m: {min: -1, max: 2, bins: 4}}", "distance_m.min: should be 0 or more, got -1.0"),
        ("{distance_m: {min: 2, max: 1, bins: 4}}", "distance_m.min: should be below max, 1.0, got 2.0"),
        (
            "{hit_angle_rad: {min: 1, max: 70, bins: 4}}",
            "hit_angle_rad.max: should be from -1.5708 to 1.5708 rad, got 70.0",
        ),
        (
            "{hit_angle_rad: {min: -2, max: 1, bins: 4}}",
            "hit_angle_rad.min: should be from -1.5708 to 1.5708 rad, got -2.0",
        ),
        (
            "{height_m: {min: 0, max: 1, bins: 4}}",
            "height_m: should be left out, as scene.landing_height_m is not swept",
        ),
        ("{distance_m: {min: 1, max: 2}}", "distance_m.bins: missing; should be a whole number from 1 to 1000"),
        ("{distnace_m: {min: 1, max: 2, bins: 4}}", "distnace_m: unknown key; did you mean 'distance_m'?"),
        (
            "{distance_m: {min: 1, max: 2, bins: 200}, hit_angle_rad: {min: 1, max: 1.2, bins: 100}}",
            "hit_angle_rad.bins: makes 20000 cells together with the others; there may be 10000",
        ),
    ],
)
def test_targets_that_cannot_be_spread_over_are_named(problems_of, target, message):
    assert problems_of(f"trials: 9\nsweep: {{{PARAMETERS}, target: {target}}}") == [
        f"run.yaml:2: sweep.target.{message}"
    ]


def test_a_target_begins_with_sobol_and_has_parameters(problems_of):
    target = "target: {distance_m: {min: 1, max: 2, bins: 4}}"
    assert problems_of(f"trials: 9\nsweep: {{sampler: uniform, {PARAMETERS}, {target}}}") == [
        "run.yaml:2: sweep.sampler: should be sobol, with which the search for target begins, got uniform"
    ]
    assert problems_of(f"trials: 9\nsweep: {{{target}}}") == [
        "run.yaml:2: sweep.parameters: missing; target should have parameters to reach it with"
    ]
    assert problems_of(f"sweep: {{{PARAMETERS}, {target}}}") == [
        "run.yaml: trials: missing; the sampler sobol should know how many trials to draw, or until how many have "
        "landed"
    ]


def test_until_wants_a_number_and_a_sampler_that_goes_on(problems_of):
    assert problems_of("until: 5") == ["run.yaml:1: until: should be {landed: …} or null, got 5"]
    assert problems_of("until: {landed: 0}") == [
        "run.yaml:1: until.landed: should be a whole number from 1 to 1000000, got 0"
    ]
    assert problems_of("until: {landed: 5}\nsweep: {sampler: list, file: a.csv}") == [
        "run.yaml:1: until: should be left out, as the file of the sampler list is not part of the dataset"
    ]


def test_until_is_enough_for_samplers_that_draw(tmp_path):
    path = tmp_path / "run.yaml"
    path.write_text(f"until: {{landed: 5}}\nsweep: {{{PARAMETERS}}}")
    config = load(path)
    assert config.until is not None
    assert config.until.landed == 5
    assert config.grows
    path.write_text(dump_yaml(config))
    assert load(path) == config


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("unknown_{}: 1\n", "unknown_0: unknown key; known keys here: name"),
        ("name: a\n", "name: the key is here twice, first in line 1"),
    ],
)
def test_of_very_many_problems_the_first_are_told_and_the_others_counted(line, message, tmp_path):
    path = tmp_path / "many.yaml"
    path.write_text("name: a\n" + "".join(line.format(number) for number in range(500)))
    with pytest.raises(ConfigError) as caught:
        load(path)
    lines = str(caught.value).splitlines()
    assert len(lines) == 21
    assert lines[0].startswith(f"{path}:2: {message}")
    assert lines[-1] == "and 480 more"


def test_suggestions_are_not_looked_for_where_nobody_would_read_them(tmp_path, monkeypatch):
    asked = []

    def near(word, known, count):
        asked.append(word)
        return []

    monkeypatch.setattr("throwcollect.config.problems.get_close_matches", near)
    path = tmp_path / "many.yaml"
    path.write_text("task: {end: {" + ", ".join(f"joint_{number}: 1" for number in range(500)) + "}}\n")
    with pytest.raises(ConfigError, match=r"task\.end\.joint_0: Talos has no joint 'joint_0'\n"):
        load(path)
    assert len(asked) <= 200
