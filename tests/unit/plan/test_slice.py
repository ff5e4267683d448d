"""Slices are whole shards, together they are the plan, and nothing is in two of them."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.unit.plan.own_plan import make_plan

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.plan.plan import Plan
from throwcollect.plan.slice import Slice

SWEPT = {
    "trials": 10,
    "record": {"trials_per_shard": 3},
    "sweep": {"sampler": "uniform", "parameters": {"ball.mass_kg": {"min": 0.03, "max": 0.06}}},
}


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(Config.model_validate(SWEPT))


@given(st.integers(1, 500), st.integers(1, 40), st.data())
def test_slices_are_the_plan_in_whole_shards(trials: int, per_shard: int, data: st.DataObject) -> None:
    shards = -(-trials // per_shard)
    count = data.draw(st.integers(1, shards))
    ranges = [each.trials_of(trials, trials_per_shard=per_shard) for each in Slice.all_of(count)]
    assert list(chain(*ranges)) == list(range(trials))
    assert all(each.start % per_shard == 0 for each in ranges)
    sizes = [-(-len(each) // per_shard) for each in ranges]
    assert max(sizes) - min(sizes) <= 1


def test_a_plan_with_too_few_shards_is_an_error() -> None:
    with pytest.raises(ConfigError, match=r"10 trials are 4 shards of 3, fewer than 5 slices\n  expected: at most 4 "):
        Slice(0, 5).trials_of(10, trials_per_shard=3)


def test_a_slice_is_printed_as_it_is_parsed() -> None:
    assert Slice.parse("3/8") == Slice(3, 8)
    assert str(Slice(3, 8)) == "3/8"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("8/8", "0/8 to 7/8"),
        ("0/0", "COUNT to be 1 or more"),
        ("1", "INDEX/COUNT"),
    ],
)
def test_a_malformed_slice_is_refused(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Slice.parse(text)


def test_a_slice_of_a_plan_keeps_the_numbers_of_its_trials(plan: Plan) -> None:
    part = plan.slice_of(Slice(1, 2))
    assert [trial.number for trial in part.trials] == [6, 7, 8, 9]
    assert part.trial(7) == plan.trial(7)
    with pytest.raises(IndexError):
        part.trial(5)


def test_a_slice_can_be_read_from_the_file_of_the_plan_and_from_its_own(plan: Plan, tmp_path: Path) -> None:
    plan.write(tmp_path / "plan.parquet")
    part = Plan.read(tmp_path / "plan.parquet", plan.config).slice_of(Slice(1, 2))
    assert part == plan.slice_of(Slice(1, 2))
    part.write(tmp_path / "part.parquet")
    assert Plan.read(tmp_path / "part.parquet", plan.config) == part
