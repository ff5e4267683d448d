import os
import stat
import subprocess
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import pytest

from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.run_record import NodeState, RunFailure, RunRecord
from throwcollect.dataset.summary import Info
from throwcollect.errors import ConfigError
from throwcollect.state_directory import STATE_VARIABLE

NOW = datetime.now(timezone.utc)
SUMMARY = Info("small", 3, 3, {"landed": 3}, None, {"x_m": (1.0, 2.0), "y_m": (0.0, 0.1)}, 30, 1.0, 1, 10, 5, {}, "0")
PROGRESS = Progress(7, 0, {}, 2, 0.0, [])
NODE = NodeState("sim_0", "restarting", 2, None, "ended by SIGKILL")


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    return tmp_path / "state"


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat(follow_symlinks=False).st_mode)


def record(run: Run, **fields: Any) -> RunRecord:
    begun = run.begin("small", Path("/data/small"), runtime="local")
    return replace(begun, **{"started": NOW, "launcher": 1, "simulations": 2, **fields})


def remember(records: Records, **fields: object) -> str:
    """A run whose launcher is gone."""
    run = records.new("small")
    run.write(record(run, **fields))
    run.close()
    return run.id


def test_a_written_and_updated_record_can_be_read_again(state: Path) -> None:
    run = Records().new("small")
    written = record(run, nodes=(NODE,), progress=PROGRESS, endpoint="tcp/127.0.0.1:1", summary=SUMMARY)
    run.write(written)
    assert Records().get(run.id).record == written
    run.update(progress=replace(PROGRESS, ended=5), failure=RunFailure("ä"))
    assert Records().get(run.id).record == replace(
        written, progress=replace(PROGRESS, ended=5), failure=RunFailure("ä")
    )
    assert Records().ids() == [run.id]


def test_the_id_of_a_run_begins_with_the_name_of_its_collection_and_is_unique(
    state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    draws = iter(["aaaa", "aaaa", "bbbb"])
    monkeypatch.setattr("throwcollect.collect.runs.records.secrets.token_hex", lambda _: next(draws))
    records = Records()
    assert [records.new("small").id, records.new("small").id] == ["small-aaaa", "small-bbbb"]


def test_a_run_is_handed_to_another_process_without_ever_seeming_dead(state: Path) -> None:
    records = Records()
    run = records.new("small")
    run.write(record(run))
    with subprocess.Popen(["/bin/cat"], stdin=-1, pass_fds=[run.lock]) as process:
        inherited = records.open(run.id, lock=os.dup(run.lock))
        run.close()
        inherited.close()
        assert run.is_locked()
        process.kill()
        process.wait()
    assert not run.is_locked()


def test_only_one_process_can_take_over_a_dead_run(state: Path) -> None:
    records = Records()
    name = remember(records)
    taken = records.take(name)
    assert taken is not None
    assert records.take(name) is None
    assert records.get(name).status == "running"
    taken.update(simulations=5)
    taken.close()
    assert records.get(name).record.simulations == 5


def test_runs_are_found_by_any_spelling_of_their_directory(
    state: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "configs").mkdir()
    (tmp_path / "link").symlink_to("data")
    records = Records()
    run = records.new("small")
    run.write(record(run, directory=str(tmp_path / "data")))
    run.close()
    monkeypatch.chdir(tmp_path / "configs")
    for spelling in (tmp_path / "data", Path("../data"), tmp_path / "link", Path("../configs/../link")):
        assert [found.id for found in records.into(spelling)] == [run.id]
    assert records.into(tmp_path / "configs") == []


def test_forgetting_a_run_removes_all_its_files_except_the_dataset(state: Path, tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    records = Records()
    run = records.new("small")
    run.write(record(run, directory=str(tmp_path / "data")))
    (run.files / "logs").mkdir(parents=True)
    run.forget()
    assert list((state / "runs").iterdir()) == []
    assert (tmp_path / "data").exists()


@pytest.mark.parametrize(
    ("fields", "remembered"),
    [
        ({"ended": NOW - timedelta(days=6)}, True),
        ({"ended": NOW - timedelta(days=8)}, False),
        ({"started": NOW - timedelta(days=8)}, False),
        ({"started": NOW - timedelta(days=8), "runtime": "docker"}, True),
        ({"started": NOW - timedelta(days=8), "ended": NOW}, True),
    ],
)
def test_runs_are_remembered_for_a_week_after_their_end(
    fields: dict[str, object], remembered: bool, state: Path
) -> None:
    records = Records()
    name = remember(records, **fields)
    written = max(each for each in (*fields.values(), NOW - timedelta(days=9)) if isinstance(each, datetime))
    os.utime(state / "runs" / f"{name}.json", times=(written.timestamp(), written.timestamp()))
    records.new("small")
    assert (name in records.ids()) == remembered


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[: len(text) // 2],
        lambda _: "",
        lambda text: text.replace('"launcher"', '"starter"'),
    ],
)
def test_a_damaged_record_is_an_error_but_other_runs_can_be_listed(damage: Callable[[str], str], state: Path) -> None:
    records = Records()
    name, whole = remember(records), remember(records)
    path = state / "runs" / f"{name}.json"
    path.write_text(damage(path.read_text()))
    with pytest.raises(ConfigError, match="the record is damaged, or of another version") as caught:
        records.get(name)
    assert caught.value.hint == f"throwcollect down --run {name} ends what is left of it, and forgets it"
    assert [each.record.run for each in records.all()] == [whole]
    records.new("small")


def test_the_files_and_directories_of_a_run_are_private(state: Path) -> None:
    state.mkdir(mode=0o755)
    (state / "runs").mkdir(mode=0o755)
    before = os.umask(0)
    try:
        run = Records().new("small")
        run.write(record(run))
    finally:
        os.umask(before)
    runs = state / "runs"
    assert (mode(runs), mode(run.files), mode(run.key.directory)) == (0o700, 0o700, 0o700)
    files = [path for path in runs.rglob("*") if path.is_file()]
    assert sorted(path.name for path in files) == ["certificate.pem", "key.pem", f"{run.id}.json", f"{run.id}.lock"]
    assert {mode(path) for path in files} == {0o600}


def test_every_run_has_its_own_key_until_the_run_is_forgotten(state: Path) -> None:
    records = Records()
    names = [remember(records), remember(records)]
    keys = [records.get(name).key for name in names]
    assert len({key.private_key.read_bytes() for key in keys}) == 2
    taken = records.take(names[0])
    assert taken is not None
    assert (taken.key, taken.key.exists) == (keys[0], True)
    taken.forget()
    assert (keys[0].exists, keys[1].exists) == (False, True)
