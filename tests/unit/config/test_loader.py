"""Configurations are read from files and overrides, and are equal after they are written and read back."""

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from throwcollect.config.loader import dump_yaml, load
from throwcollect.config.schema import (
    BallConfig,
    Config,
    DynamicMovementPrimitive,
    MinimumJerk,
    Range,
    SweepConfig,
    Values,
)
from throwcollect.errors import ConfigError
from throwcollect.tasks.throw.throw_config import ThrowConfig

CONFIGS = Path(__file__).parents[3] / "configs"


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.name)
def test_every_configuration_in_configs_loads_under_its_name(path):
    config = load(path)
    assert config.name == path.stem


def test_a_missing_key_takes_its_default(write):
    assert load(write("name: short")) == Config(name="short")


def test_the_family_of_a_trajectory_may_be_left_out(write):
    assert load(write("task: {trajectory: {gamma: 1.1}}")).task.trajectory == MinimumJerk(gamma=1.1)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "run.yaml: the file is empty"),
        (b"a: 1\nb: \xff\n", "run.yaml: cannot be read: no UTF-8 text: byte 8"),
    ],
)
def test_a_file_that_holds_no_configuration_is_refused_with_its_line(tmp_path, content, message):
    path = tmp_path / "run.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=re.escape(f"{tmp_path}/{message}")) as caught:
        load(path)
    assert [str(problem) for problem in caught.value.problems] == [f"{tmp_path}/{message}"]


def test_overrides_replace_values_of_the_file_and_earlier_overrides(write):
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
        ("bal.mass_kg=1", "bal: unknown key; did you mean 'ball'?"),
    ],
)
def test_a_wrong_override_is_reported_without_a_line_of_the_file(problems_of, override, message):
    file = "ball: {mass_kg: 0.1}\nrecord: {topics: [joint_states, ball/odometry]}"
    assert problems_of(file, override) == [message]


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
                alpha_z=st.floats(0, 1000, exclude_min=True),
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


@settings(deadline=None, max_examples=30)
@given(config=configs)
def test_a_dumped_configuration_loads_back_equal(tmp_path_factory, config):
    path = tmp_path_factory.getbasetemp() / "resolved.yaml"
    text = dump_yaml(config)
    path.write_text(text, encoding="utf-8", newline="")
    loaded = load(path)
    assert loaded == config
    assert dump_yaml(loaded) == text


def test_a_dumped_configuration_shows_defaults_too():
    lines = dump_yaml(Config()).splitlines()
    assert "  mass_kg: 0.045" in lines
    assert "  topics: [joint_states, ball/odometry]" in lines
    assert "trials: null" in lines
    assert dump_yaml(Config(name="on")).startswith('name: "on"\n')


def test_an_override_of_one_joint_keeps_the_values_of_the_others(tmp_path: Path) -> None:
    path = tmp_path / "throws.yaml"
    path.write_text("name: throws\n")
    default = load(path).task.end
    changed = load(path, ["task.end.arm_right_4_joint=-0.3", "task.end.torso_1_joint=0.1"]).task.end
    assert changed == {**default, "arm_right_4_joint": -0.3, "torso_1_joint": 0.1}
    # The file names the moving joints: an override adds to these.
    path.write_text("name: throws\ntask: {end: {arm_right_4_joint: -0.5}}\n")
    assert load(path, ["task.end.arm_right_7_joint=0.4"]).task.end == {
        "arm_right_4_joint": -0.5,
        "arm_right_7_joint": 0.4,
    }
    # A wrong joint is reported at the override, not at the defaults.
    path.write_text("name: throws\n")
    with pytest.raises(ConfigError, match=r"^task\.end\.arm_right_9_joint: "):
        load(path, ["task.end.arm_right_9_joint=1"])
