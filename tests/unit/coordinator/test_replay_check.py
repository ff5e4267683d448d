"""Some trials are simulated again in a fresh process, which may begin before the compared trials are known."""

import json
import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.unit.sweep.own_plan import make_plan

from throwcollect.config.schema import Config
from throwcollect.coordinator import replay_check
from throwcollect.coordinator.replay_check import ReplayCheck
from throwcollect.dataset.creation import create
from throwcollect.dataset.throws_table import Row
from throwcollect.errors import DatasetError, WorkerError
from throwcollect.replay.replayer import Replayer
from throwcollect.sweep.plan import Plan
from throwcollect.trial.choice import choose_trials

PLAN: Plan = make_plan(
    Config.model_validate(
        {
            "name": "again",
            "trials": 6,
            "sweep": {"sampler": "uniform", "parameters": {"ball.mass_kg": {"min": 0.03, "max": 0.06}}},
            "sim": {"engine": "ballistic"},
        }
    )
)
NUMBERS = list(PLAN.trials.numbers_to_run)
CHOSEN = choose_trials(NUMBERS, count=2, seed=PLAN.config.seed)


TALKATIVE = """
import os
from throwcollect.engines.ballistic.ballistic_engine import BallisticEngine

run = BallisticEngine.run

def talk(*arguments):
    print("I run", flush=True)
    os.write(1, b"and a library of mine, too")
    return run(*arguments)

BallisticEngine.run = talk
"""


@pytest.fixture(scope="module")
def rows() -> dict[int, Row]:
    replayer = Replayer(PLAN.config)
    found = {}
    for trial in PLAN.trials:
        delivery = replayer.delivery(trial)
        found[trial.number] = {
            "trial": trial.number,
            "digest": delivery.episode.digest,
            **json.loads(delivery.result),
            **trial.values,
        }
    replayer.close()
    return found


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The trials of each started process."""
    found: list[list[str]] = []
    popen = subprocess.Popen

    def note(command: list[str], **kwargs: object) -> object:
        found.append(command[command.index("simulate") + 2 :])
        return popen(command, **kwargs)

    monkeypatch.setattr(replay_check.subprocess, "Popen", note)
    return found


@pytest.fixture
def check(tmp_path: Path) -> Iterator[ReplayCheck]:
    create(tmp_path / "data", PLAN)
    check = ReplayCheck(tmp_path / "data", count=2, seed=PLAN.config.seed)
    yield check
    check.close()


def words(trials: list[int]) -> list[str]:
    return [str(trial) for trial in trials]


def compare(check: ReplayCheck, rows: dict[int, Row]) -> str | None:
    return check.compare(rows, meanwhile=lambda: time.sleep(0.01))


def test_a_replay_check_uses_the_trials_that_were_begun_early(check, rows, started, monkeypatch) -> None:
    # The process writes for this one, so it does not matter how the user wants to read output.
    monkeypatch.setenv("PYTHONIOENCODING", "utf-16")
    check.begin(NUMBERS)
    assert compare(check, rows) == "2 trials simulated again in a fresh process: the same bit for bit"
    assert started == [words(CHOSEN)]


def test_a_replay_check_overlooks_what_parts_of_other_packages_print(check, rows, tmp_path, monkeypatch) -> None:
    # Python imports this module when it starts, and with it the engine that prints.
    (tmp_path / "sitecustomize.py").write_text(TALKATIVE)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    assert compare(check, rows) == "2 trials simulated again in a fresh process: the same bit for bit"


def test_a_replay_check_compares_the_chosen_trials_even_if_others_were_begun(check, rows, started) -> None:
    check.begin(NUMBERS)
    kept = {trial: row for trial, row in rows.items() if trial not in CHOSEN}
    compare(check, kept)
    assert started == [words(CHOSEN), words(choose_trials(sorted(kept), count=2, seed=PLAN.config.seed))]


def test_a_replay_process_begun_early_that_fails_is_replaced(check, rows, started) -> None:
    check.begin([10**6, 10**6 + 1])
    assert compare(check, rows) is not None
    assert started == [words([10**6, 10**6 + 1]), words(CHOSEN)]


@pytest.mark.parametrize("early", [False, True])
@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"digest": "0" * 64, "landing_x_m": 1.0}, f"digest is {'0' * 64} in the dataset, "),
        ({"landing_x_m": 1.0}, "landing_x_m is 1.0 in the dataset, "),
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


def test_a_replay_process_that_fails_is_an_error(check, rows, tmp_path) -> None:
    (tmp_path / "data" / "plan.parquet").unlink()
    with pytest.raises(WorkerError, match="2 trials could not be simulated again \\(exit code") as caught:
        compare(check, rows)
    assert "plan.parquet" in (caught.value.evidence or "")


def test_closing_a_replay_check_ends_its_process(check, monkeypatch) -> None:
    begun: list[subprocess.Popen[bytes]] = []
    popen = subprocess.Popen

    def note(*arguments: object, **kwargs: object) -> object:
        begun.append(popen(*arguments, **kwargs))
        return begun[0]

    monkeypatch.setattr(replay_check.subprocess, "Popen", note)
    check.begin(NUMBERS)
    check.close()
    assert begun[0].poll() is not None


def test_a_replay_process_has_its_own_session_so_ctrl_c_does_not_reach_it(check, monkeypatch) -> None:
    sessions: list[int] = []
    popen = subprocess.Popen

    def note(*arguments: object, **kwargs: object) -> object:
        process = popen(*arguments, **kwargs)
        sessions.append(os.getsid(process.pid))
        return process

    monkeypatch.setattr(replay_check.subprocess, "Popen", note)
    check.begin(NUMBERS)
    check.close()
    assert len(sessions) == 1
    assert sessions != [os.getsid(0)]


def test_a_replay_check_of_no_trials_starts_no_process(tmp_path, started) -> None:
    check = ReplayCheck(tmp_path, count=0, seed=1)
    check.begin(NUMBERS)
    assert compare(check, {1: json.dumps(1)}) is None
    assert started == []
