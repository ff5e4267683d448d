"""Two processes never change one dataset at the same time."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.mutations import SETTINGS, finish

from throwcollect.collect.coordinator.resume import resume
from throwcollect.dataset.creation import create
from throwcollect.dataset.lock import hold_lock, is_locked
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import DatasetError

BUSY = r"dataset: another process collects into it, or changes it\n  try: throwcollect ps"


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("throwcollect.dataset.lock.PATIENCE_S", 0.0)


@pytest.fixture
def begun(tmp_path: Path) -> Path:
    create(tmp_path / "dataset", Collection(SETTINGS).plan)
    return tmp_path / "dataset"


def go_on(directory: Path) -> None:
    more = Collection({**SETTINGS, "trials": 3}).config
    resume(more, directory, sweep_directory=directory)


def contents(directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.iterdir() if path.is_file()}


@pytest.mark.parametrize("change", [go_on, finish])
def test_a_dataset_that_is_being_collected_cannot_be_resumed(begun: Path, change: Callable[[Path], object]) -> None:
    before = contents(begun)
    with closing(DatasetWriter.open(begun)) as writer:
        with pytest.raises(DatasetError, match=BUSY):
            change(begun)
        assert contents(begun) == before
        writer.recover()


def test_a_dataset_cannot_be_resumed_while_its_coordinator_restarts(begun: Path) -> None:
    with hold_lock(begun, alone=False):
        DatasetWriter.open(begun).close()
        with pytest.raises(DatasetError, match=BUSY):
            go_on(begun)


def test_a_dataset_that_is_being_prepared_cannot_be_collected(begun: Path) -> None:
    with hold_lock(begun), pytest.raises(DatasetError, match=BUSY):
        DatasetWriter.open(begun)
    DatasetWriter.open(begun).close()


def test_two_collections_cannot_be_prepared_in_one_directory(tmp_path: Path) -> None:
    (tmp_path / "dataset").mkdir()
    with hold_lock(tmp_path / "dataset"), pytest.raises(DatasetError, match=BUSY):
        create(tmp_path / "dataset", Collection(SETTINGS).plan)
    assert list((tmp_path / "dataset").iterdir()) == []


def test_a_lock_waits_for_a_killed_process_to_end(begun: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("throwcollect.dataset.lock.PATIENCE_S", 60.0)
    code = "import fcntl, os, sys, time; fcntl.flock(os.open(sys.argv[1], 0), 1); print(flush=True); time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", code, str(begun)], stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        other.stdout.readline()
        other.kill()
        with hold_lock(begun):
            pass


@pytest.mark.parametrize("alone", [True, False])
def test_is_locked_is_true_only_while_a_lock_is_held(begun: Path, alone: bool) -> None:
    assert not is_locked(begun)
    with hold_lock(begun, alone=alone):
        assert is_locked(begun)
    assert not is_locked(begun)


def test_a_collection_begins_while_another_process_briefly_checks_the_lock(
    begun: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # On a busy machine, the other process may hold the lock for longer.
    monkeypatch.setattr("throwcollect.dataset.lock._GLANCE_S", 30.0)
    code = "import fcntl, os, sys, time; fcntl.flock(os.open(sys.argv[1], 0), 2); print(flush=True); time.sleep(0.02)"
    with subprocess.Popen([sys.executable, "-c", code, str(begun)], stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        other.stdout.readline()
        DatasetWriter.open(begun).close()
