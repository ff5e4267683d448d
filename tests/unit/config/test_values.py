import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from throwcollect.config.loader import dump_yaml, load
from throwcollect.config.schema import Config, DynamicMovementPrimitive
from throwcollect.config.values import reason_not_sweepable, sweepable_keys, values_by_key, with_values
from throwcollect.errors import ConfigError
from throwcollect.tasks.throw.throw_config import ThrowConfig

LEARNED = Config(
    task=ThrowConfig(
        trajectory=DynamicMovementPrimitive(
            family="dmp", basis_functions=3, weights={"arm_right_4_joint": [1.0, 2.0, 3.0]}
        )
    )
)
BOUNDS = {
    "task.duration_s": (0.1, 10),
    "task.end.arm_right_4_joint": (-6.3, 6.3),
    "task.start.torso_1_joint": (-6.3, 6.3),
    "task.trajectory.alpha_z": (1e-9, 1e3),
    "task.trajectory.weights.arm_right_4_joint.2": (-1e9, 1e9),
    "ball.mass_kg": (1e-9, 2),
    "robot.effort_scale": (1e-9, 10),
    "sim.command_delay_s": (0, 0.2),
}


@settings(deadline=None, max_examples=40)
@given(st.fixed_dictionaries({}, optional={key: st.floats(*bounds) for key, bounds in BOUNDS.items()}))
def test_with_values_gives_the_same_configuration_as_overrides(tmp_path_factory, values):
    path = tmp_path_factory.getbasetemp() / "edited.yaml"
    path.write_text(dump_yaml(LEARNED))
    edited = load(path, [f"{key}={value!r}" for key, value in values.items()])
    assert with_values(LEARNED, values) == edited


def test_with_values_does_not_change_the_given_configuration():
    before = dump_yaml(LEARNED)
    with_values(LEARNED, {key: 1.0 for key in BOUNDS if key != "sim.command_delay_s"})
    assert dump_yaml(LEARNED) == before


def test_with_values_accepts_numbers_of_numpy():
    assert with_values(Config(), {"ball.mass_kg": np.float64(0.25)}).ball.mass_kg == 0.25


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"ball.mas_kg": 1}, r"^ball\.mas_kg: unknown key; did you mean 'mass_kg'\?$"),
        ({"task.duration_s.x": 1}, r"^task\.duration_s\.x: unknown key; no keys are expected here$"),
        ({"record.rate_hz": 300}, r"^record\.rate_hz: should divide sim\.physics_hz, 500, got 300$"),
    ],
)
def test_with_values_refuses_wrong_keys_and_values_with_a_reason(values, message):
    with pytest.raises(ConfigError, match=message):
        with_values(LEARNED, values)


def test_leaves_of_a_configuration_are_the_keys_without_keys_below():
    found = values_by_key(LEARNED)
    assert found["ball.mass_kg"] == 0.045
    assert found["task.trajectory.weights.arm_right_4_joint.1"] == 2.0
    assert found["robot.posture"] == {}
    assert "task.end" not in found


@pytest.mark.parametrize("key", [*BOUNDS, "scene.gravity_mps2", "sim.settle_s", "robot.velocity_gain"])
def test_keys_that_may_vary_between_trials_can_be_swept(key):
    assert reason_not_sweepable(LEARNED, key) is None
    assert key in sweepable_keys(LEARNED)


@pytest.mark.parametrize(
    ("key", "reason"),
    [
        ("task.durations_s", "unknown key; did you mean 'task.duration_s'?"),
        (
            "task.trajectory.basis_functions",
            "cannot be swept, as it is an integer; the values of a sweep have decimals",
        ),
        ("seed", "cannot vary from trial to trial"),
    ],
)
def test_keys_that_cannot_be_swept_have_a_reason(key, reason):
    assert reason_not_sweepable(LEARNED, key) == reason
    assert key not in sweepable_keys(LEARNED)
