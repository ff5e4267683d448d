"""Some trials are simulated again in a fresh process, which may begin before the compared trials are known."""

import json
import multiprocessing
import time
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pytest
from tests.unit.plan.own_plan import make_plan

from throwcollect.collect.coordinator.replay_check import ReplayCheck
from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.dataset.creation import create
from throwcollect.dataset.throws_table import Row
from throwcollect.errors import DatasetError, WorkerError
from throwcollect.plan.plan import Plan
from throwcollect.plan.trials import choose_trials
from throwcollect.side_by_side import Workers
from throwcollect.sim.simulator import Simulator

PLAN: Plan = make_plan(
    Config.model_validate(
        {
            "name": "again",
            "trials": 6,
            "sweep": {"sampler": "uniform", "parameters": {"ball.mass_kg": {"min": 0.03, "max": 0.06}}},
            "sim": {"engine": "ballistic"},
            "run": {"replay": 2},
        }
    )
)
NUMBERS = list(PLAN.trials.numbers_to_run)
CHOSEN = choose_trials(NUMBERS, count=2, seed=PLAN.config.seed)


@pytest.fixture(scope="module")
def rows() -> dict[int, Row]:
    simulator = Simulator(PLAN.config)
    found = {}
    for trial in PLAN.trials:
        episode = simulator.run(trial)
        found[trial.number] = {
            "trial": trial.number,
            "digest": episode.digest,
            **json.loads(episode.result),
            **trial.values,
        }
    simulator.close()
    return found


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[list[int]]:
    """The trials of each started process."""
    found: list[list[int]] = []
    submit = Workers.submit

    def note(workers: Workers[int, Row], trials: list[int]) -> object:
        found.append(trials)
        return submit(workers, trials)

    monkeypatch.setattr(Workers, "submit", note)
    return found


@pytest.fixture
def check(tmp_path: Path) -> Iterator[ReplayCheck]:
    create(tmp_path / "data", PLAN)
    check = ReplayCheck(tmp_path / "data", PLAN.config)
    yield check
    check.close()


def compare(check: ReplayCheck, rows: dict[int, Row]) -> str | None:
    empty = {"trial": pa.array([], pa.int64()), "digest": pa.array([], pa.string())}
    throws = pa.Table.from_pylist([*rows.values()]) if rows else pa.table(empty)
    return check.compare(throws, meanwhile=lambda: time.sleep(0.01))


def test_a_replay_check_uses_the_trials_that_were_begun_early(check, rows, started) -> None:
    check.begin(NUMBERS)
    assert compare(check, rows) == "2 trials simulated again in a fresh process: the same bit for bit"
    assert started == [CHOSEN]


def test_a_replay_check_compares_the_chosen_trials_even_if_others_were_begun(check, rows, started) -> None:
    check.begin(NUMBERS)
    kept = {trial: row for trial, row in rows.items() if trial not in CHOSEN}
    compare(check, kept)
    assert started == [CHOSEN, choose_trials(sorted(kept), count=2, seed=PLAN.config.seed)]


@pytest.mark.parametrize(
    ("early", "change", "said"),
    [
        (True, {"digest": "0" * 64, "landing_x_m": 1.0}, f"digest is {'0' * 64} in the dataset, "),
        (False, {"landing_x_m": 1.0}, "landing_x_m is 1.0 in the dataset, "),
    ],
    ids=["the episode", "a measure"],
)
def test_a_trial_that_replays_differently_is_an_error(check, rows, early, change, said) -> None:
    if early:
        check.begin(NUMBERS)
    error = f"1 of 2 trials came out differently in a fresh process: trial {CHOSEN[1]}"
    with pytest.raises(DatasetError, match=error) as caught:
        compare(check, {**rows, CHOSEN[1]: {**rows[CHOSEN[1]], **change}})
    assert f"trial {CHOSEN[1]}: {said}" in str(caught.value.evidence)


def test_a_replay_process_that_is_killed_is_an_error(check, rows) -> None:
    check.begin(NUMBERS)
    for process in multiprocessing.active_children():
        process.kill()
    with pytest.raises(WorkerError, match="a process that simulates trials again was killed"):
        compare(check, rows)


def test_a_replay_check_of_no_trials_starts_no_process(tmp_path, started) -> None:
    check = ReplayCheck(tmp_path, with_values(PLAN.config, {"run.replay": 0}))
    check.begin(NUMBERS)
    assert compare(check, {1: {"trial": 1, "digest": "d"}}) is None
    assert started == []
