import pytest
from pydantic import ValidationError

from throwcollect.config.schema import Config, Range, SweepConfig, Values
from throwcollect.tasks.throw.config import ThrowConfig


def test_every_key_has_a_default_so_that_an_empty_configuration_is_one():
    assert Config().task.trajectory.family == "minimum_jerk"


def test_values_never_change():
    with pytest.raises(ValidationError, match="frozen"):
        Config().ball.mass_kg = 1.0


def test_parameters_are_told_apart_by_their_keys():
    sweep = SweepConfig.model_validate({"parameters": {"a": {"values": [1]}, "b": {"min": 1, "max": 2}}})
    assert sweep.parameters == {"a": Values(values=[1.0]), "b": Range(min=1.0, max=2.0)}


def test_contradictions_name_every_key_that_takes_part():
    with pytest.raises(
        ValidationError, match=r"end\.head_1_joint: start should name .*; end\.head_2_joint: start should name"
    ):
        ThrowConfig(end={"head_1_joint": 0.0, "head_2_joint": 0.0})


def test_slots_of_trials_do_not_overlap_and_none_starts_at_zero():
    config = Config()
    starts = [config.trial_start_ns(number) for number in range(3)]
    assert starts[0] > 0
    assert starts[1] - starts[0] == starts[2] - starts[1] > config.sim.max_trial_s * 10**9
