import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import pytest
from tests.unit.collect.runtimes.docker.engine import Engine, engine_at

from throwcollect.collect.coordinator.reporter import SILENT
from throwcollect.collect.runs.control import down
from throwcollect.collect.runs.preparation import end_left
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run_selection import (
    find_run_to_change,
    find_run_to_watch,
    require_living,
)
from throwcollect.collect.runtimes.docker import docker_engine as docker_engine
from throwcollect.collect.runtimes.docker.container_options import NODE_LABEL, RUN_LABEL
from throwcollect.collect.runtimes.run_record import RunFailure, RunRecord
from throwcollect.errors import ConfigError, DatasetError, Interrupted, ThrowcollectError, WorkerError
from throwcollect.state_directory import STATE_VARIABLE

NOW = datetime.now(timezone.utc)
Make = Callable[..., RunRecord]


@pytest.fixture
def records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Records:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    return Records()


@pytest.fixture
def make(records: Records, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    """Makes a run: ``lives``, ``died`` or ``ended``, in directories of its own unless told otherwise."""
    held = ExitStack()

    def make(name: str, status: str, *, age_h: int = 0, **fields: Any) -> RunRecord:
        monkeypatch.setattr("throwcollect.collect.runs.records.secrets.token_hex", lambda _: "0123")
        run = records.new(name)
        begun = replace(run.begin(name, tmp_path / name, runtime="local"), logs=tmp_path / "logs")
        ended = NOW if status == "ended" else None
        run.write(replace(begun, **{"started": NOW - timedelta(hours=age_h), "launcher": 1, "ended": ended, **fields}))
        if status == "lives":
            held.callback(run.close)
        else:
            run.close()
        return run.record

    with held:
        yield make


@pytest.mark.parametrize("named", ["b-0123", "b", "b-0"])
def test_a_run_is_found_by_its_id_or_the_beginning_of_it(named: str, records: Records, make: Make) -> None:
    make("a", "lives")
    record = make("b", "ended")
    assert find_run_to_change(named).record == record


def test_a_run_is_found_by_the_directory_of_its_dataset(
    records: Records, make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make("a", "ended", age_h=2, directory=tmp_path / "data")
    latest = make("b", "ended", age_h=1, directory=tmp_path / "data")
    monkeypatch.chdir(tmp_path)
    assert find_run_to_change("data").record == latest
    assert find_run_to_change(str(tmp_path / "data")).record == latest


def test_an_ambiguous_or_unknown_id_is_refused_with_a_list_of_runs(records: Records, make: Make) -> None:
    with pytest.raises(ConfigError, match="no run 'x'"):
        find_run_to_change("x")
    make("ab", "ended", age_h=1)
    make("ac", "ended")
    with pytest.raises(ConfigError, match=r"2 runs begin with 'a'\n  expected: one of ab-0123, ac-0123"):
        find_run_to_change("a")
    with pytest.raises(ConfigError, match=r"no run 'x'; known: ab-0123 and ac-0123"):
        find_run_to_change("x")


def test_without_an_id_the_only_living_run_is_changed(records: Records, make: Make) -> None:
    with pytest.raises(ConfigError, match=r"no run lives\n  try: throwcollect up -d starts one"):
        find_run_to_change(None)
    make("a", "ended")
    make("b", "died")
    only = make("c", "lives")
    assert find_run_to_change(None).record == only
    make("d", "lives")
    with pytest.raises(ConfigError, match=r"2 runs live\n  expected: c-0123, d-0123\n  try: name one of them"):
        find_run_to_change(None)


def test_without_an_id_the_living_or_else_the_latest_run_is_watched(records: Records, make: Make) -> None:
    latest = make("a", "ended")
    make("b", "ended", age_h=1)
    assert find_run_to_watch(None).record == latest
    living = make("c", "lives", age_h=9)
    assert find_run_to_watch(None).record == living


def test_down_can_end_a_run_whose_launcher_died(records: Records, make: Make) -> None:
    record = make("a", "died")
    assert find_run_to_change(None, died=True).record == record
    with pytest.raises(ConfigError, match="no run lives"):
        find_run_to_change(None)


@pytest.mark.parametrize(
    ("code", "kind"),
    [(1, ThrowcollectError), (2, ConfigError), (3, WorkerError), (4, DatasetError), (130, Interrupted)],
)
def test_the_error_of_an_ended_run_has_the_type_of_its_exit_code(
    code: int, kind: type, records: Records, make: Make
) -> None:
    make("a", "ended", exit_code=code, failure=RunFailure("no luck", evidence="none"))
    error = records.get("a-0123").record.error
    assert (type(error), error and error.exit_code, str(error)) == (kind, code, "no luck\n  evidence: none")
    assert error is not None
    assert (error.message, error.evidence) == ("no luck", "none")


def test_only_a_living_run_can_be_changed(records: Records, make: Make) -> None:
    record = make("a", "lives")
    assert require_living(find_run_to_change("a")) == record
    make("b", "ended")
    with pytest.raises(ConfigError, match="run b-0123 has ended"):
        require_living(find_run_to_change("b"))
    make("c", "died")
    with pytest.raises(WorkerError, match="run c-0123: its launcher died; finished throws are in /"):
        require_living(find_run_to_change("c"))


def test_a_directory_into_which_a_living_run_collects_is_refused(records: Records, make: Make, tmp_path: Path) -> None:
    make("a", "lives")
    with pytest.raises(ConfigError, match=r"/a: run a-0123 collects into it\n  try: throwcollect wait --run a-0123"):
        end_left(tmp_path / "a", SILENT)
    end_left(tmp_path / "a", SILENT, own=records.get("a-0123"))
    end_left(tmp_path / "b", SILENT)


@pytest.fixture
def engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Engine]:
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/engine.sock")
    with engine_at(tmp_path / "engine.sock") as engine:
        yield engine


@pytest.mark.parametrize(
    ("fields", "ends"),
    [
        ({"runtime": "docker"}, True),
        ({"runtime": "local"}, False),
        ({"runtime": "docker", "ended": NOW}, False),
        # The launcher gave up and could not remove the containers.
        ({"runtime": "docker", "ended": NOW, "left": True}, True),
    ],
)
def test_containers_of_a_dead_launcher_are_ended_before_another_run_uses_its_directory(
    fields: dict[str, object], ends: bool, records: Records, make: Make, tmp_path: Path, engine: Engine
) -> None:
    make("a", "died", **fields)
    engine.create("throwcollect-a-0123-sim_0", {RUN_LABEL: "a-0123", NODE_LABEL: "sim_0"})
    end_left(tmp_path / "a", SILENT)
    assert (engine.names() == []) == ends


def test_the_directory_of_a_dead_docker_run_is_refused_if_the_engine_is_silent(
    records: Records, make: Make, tmp_path: Path, engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    make("a", "died", runtime="docker")
    engine.withheld = "."
    monkeypatch.setitem(docker_engine.connect.__kwdefaults__, "timeout_s", 0.1)
    with pytest.raises(
        WorkerError, match=r"/a: containers of run a-0123 may still collect into it: .*no answer in time"
    ):
        end_left(tmp_path / "a", SILENT)


def test_the_directory_of_a_dead_docker_run_is_free_if_the_engine_is_gone(
    records: Records, make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make("a", "died", runtime="docker")
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/none.sock")
    end_left(tmp_path / "a", SILENT)
    assert down(records.get("a-0123")) == []


def test_the_record_of_a_run_with_left_containers_is_kept_beyond_a_week(
    records: Records, make: Make, tmp_path: Path
) -> None:
    left = make("a", "ended", age_h=999, ended=NOW - timedelta(hours=999), left=True)
    make("b", "ended", age_h=999, ended=NOW - timedelta(hours=999))
    for path in (tmp_path / "state" / "runs").glob("*.json"):
        os.utime(path, times=(0, 0))
    records.new("c").close()
    assert [(run.record.run, run.status) for run in records.all()] == [(left.run, "abandoned")]
