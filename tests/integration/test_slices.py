"""Slices are collected one by one, as tasks of a scheduler do, and joined: the files are those of one collection."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

import throwcollect
from tests.e2e.collection import CONFIG, FAST, SENSORS, fingerprints, write_config
from throwcollect import runs
from throwcollect.collect.coordinator.prepare import prepare
from throwcollect.collect.runs.slices import collect_slice
from throwcollect.config.loader import load
from throwcollect.dataset.directory import METADATA
from throwcollect.dataset.shard import OpenShard
from throwcollect.dataset.slices import SLICES, find_attempts, find_finished, join, make_attempt, publish
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import DatasetError, Interrupted, LossError, ThrowcollectError
from throwcollect.files import unwritable
from throwcollect.plan.slice import Slice
from throwcollect.sim.simulator import Simulator

INPROCESS = ["run.runtime=inprocess"]
TEXT = CONFIG + "record: {{trials_per_shard: 2}}\n"
KILLED_ANYWHERE = """
import os, shutil, signal, sys
from pathlib import Path
from throwcollect.dataset.slices import join

source, copies = map(Path, sys.argv[1:])

def kill_at(change):
    def look(event, arguments):
        nonlocal change
        if event in ("os.rename", "os.remove", "os.rmdir") or (
            event == "open" and isinstance(arguments[2], int) and arguments[2] & os.O_ACCMODE != os.O_RDONLY
        ):
            change -= 1
            if not change:
                os.kill(os.getpid(), signal.SIGKILL)
    sys.addaudithook(look)

shutil.copytree(source, copies / "first")
join(copies / "first")  # so that the others need not import anything
shutil.rmtree(copies / "first")
for change in range(1, 1000):
    copy = copies / f"{change:03d}"
    shutil.copytree(source, copy)
    if not (process := os.fork()):
        kill_at(change)
        join(copy)
        os._exit(0)
    if not os.waitpid(process, 0)[1]:
        break
"""
"""Joins copies of a dataset: each is killed one change of the file system later, until one is finished."""


class Listener(runs.Reporter):
    """Keeps the messages that it gets."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def say(self, line: str) -> None:
        self.lines.append(line)


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_config(tmp_path_factory.mktemp("config"), trials=11, text=TEXT, sim=FAST)


@pytest.fixture(scope="module")
def whole(config: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset of a single collection, to compare with."""
    directory = tmp_path_factory.mktemp("whole") / "data"
    with runs.prepare(config, overrides=INPROCESS, output=directory) as run:
        run.collect()
    return directory


@pytest.fixture
def frozen(config: Path, tmp_path: Path) -> Path:
    """A directory that holds the plan alone."""
    prepare(load(config), tmp_path / "data", sweep_directory=tmp_path)
    return tmp_path / "data"


def collect(directory: Path, *texts: str) -> None:
    for text in texts:
        assert collect_slice(directory, Slice.parse(text), overrides=INPROCESS)


def interrupt_after(directory: Path, text: str, size: int) -> Path:
    """Interrupt the collection of a slice when it has written so many bytes; returns the directory of the attempt."""
    slice = Slice.parse(text)

    def count_bytes() -> int:
        return sum(p.stat().st_size for each in find_attempts(directory, slice) for p in each.glob("*.mcap*"))

    with pytest.raises(Interrupted, match=f"slice {text}"):
        collect_slice(directory, slice, overrides=INPROCESS, interruptions=lambda: int(count_bytes() > size))
    (attempt,) = find_attempts(directory, slice)
    return attempt


def count_kept(directory: Path, slice: Slice) -> int:
    """Collect a slice, and return how many episodes of an earlier attempt are kept."""
    reporter = Listener()
    collect_slice(directory, slice, overrides=INPROCESS, reporter=reporter)
    (kept,) = [line for line in reporter.lines if "of an earlier collection" in line]
    return int(kept.split()[1])


def test_joined_slices_give_the_files_of_one_collection(frozen: Path, whole: Path) -> None:
    collect(frozen, "2/3", "0/3", "1/3")
    join(frozen)
    assert fingerprints(frozen) == fingerprints(whole)
    assert not (frozen / SLICES).exists()


def test_an_interrupted_slice_goes_on_with_its_recordings_and_what_sensors_saw(tmp_path: Path) -> None:
    seeing = write_config(tmp_path, trials=6, text=TEXT + SENSORS.replace("{link}", "head_2_link"), sim=FAST)
    with runs.prepare(seeing, overrides=INPROCESS, output=tmp_path / "whole") as run:
        run.collect()
    frozen = tmp_path / "data"
    prepare(load(seeing), frozen, sweep_directory=tmp_path)
    interrupt_after(frozen, "0/2", 50_000)
    assert not find_finished(frozen)
    assert count_kept(frozen, Slice(0, 2)) > 0
    collect(frozen, "1/2")
    join(frozen)
    assert fingerprints(frozen) == fingerprints(tmp_path / "whole")
    assert len(throwcollect.load(frozen)[5].sensors["eye"].images) == 3


def test_a_repeated_attempt_takes_over_the_largest_stopped_one(frozen: Path, whole: Path) -> None:
    """A task that is requeued again and again does not gather files, and does not lose recordings."""
    slice = Slice(0, 2)
    sizes = []
    for size in (50_000, 100_000, 150_000):
        attempt = interrupt_after(frozen, "0/2", size)
        assert find_attempts(frozen, slice) == [attempt]
        sizes.append(sum(path.stat().st_size for path in attempt.glob("*.mcap*")))
    assert sizes == sorted(sizes)
    # This attempt died with less, and lies beside the other one.
    dead = make_attempt(frozen, slice)
    (dead / "small_00000.mcap.part").write_bytes((attempt / "small_00000.mcap").read_bytes()[:1000])
    early = frozen / SLICES / "0-of-2.attempt-a"
    dead.rename(early)
    assert count_kept(frozen, slice) >= 3
    assert find_attempts(frozen, slice) == [early]
    collect(frozen, "1/2")
    join(frozen)
    assert fingerprints(frozen) == fingerprints(whole)


def test_a_damaged_recording_of_an_attempt_does_not_change_the_dataset(
    frozen: Path, whole: Path, tmp_path: Path
) -> None:
    attempt = interrupt_after(frozen, "0/2", 150_000)
    sound = tmp_path / "sound"
    shutil.copytree(frozen, sound)
    recording = max(attempt.glob("*.mcap*"), key=lambda path: path.stat().st_size)
    data = bytearray(recording.read_bytes())
    data[len(data) // 2 :] = bytes(len(data) - len(data) // 2)
    recording.write_bytes(data)
    # Episodes of the damaged half are collected anew, all others are kept.
    assert 0 < count_kept(frozen, Slice(0, 2)) < count_kept(sound, Slice(0, 2))
    collect(frozen, "1/2")
    join(frozen)
    assert fingerprints(frozen) == fingerprints(whole)


def test_a_second_attempt_does_not_replace_a_finished_slice(frozen: Path) -> None:
    collect(frozen, "0/6")
    place = frozen / SLICES / "0-of-6"
    before = fingerprints(place)
    twin = make_attempt(frozen, Slice(0, 6))
    for name in ("small_00000.mcap", "throws.parquet", "datapackage.json"):
        (twin / name).write_bytes(b"late")
    assert not publish(twin, frozen, Slice(0, 6))
    assert fingerprints(place) == before
    assert not find_attempts(frozen, Slice(0, 6))


def test_a_finished_slice_is_not_collected_again(frozen: Path) -> None:
    collect(frozen, "0/6")
    assert not collect_slice(frozen, Slice(0, 6), overrides=INPROCESS)


def test_joining_can_be_repeated_after_a_kill_at_any_point(frozen: Path, whole: Path, tmp_path: Path) -> None:
    collect(frozen, "0/2", "1/2")
    killed = subprocess.run([sys.executable, "-c", KILLED_ANYWHERE, frozen, tmp_path / "killed"], check=False)
    assert killed.returncode == 0
    states = sorted((tmp_path / "killed").iterdir())
    # Joining is killed before, while and after it moves the shards out of their slices.
    assert {len(list(each.glob("*.mcap"))) for each in states} == set(range(7))
    assert any((each / METADATA).exists() and (each / SLICES).exists() for each in states)
    for each in states:
        join(each)
        assert fingerprints(each) == fingerprints(whole)
        assert not (each / SLICES).exists()


def test_slices_of_another_plan_are_not_joined(frozen: Path, config: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    prepare(load(config, ["seed=8"]), other, sweep_directory=tmp_path)
    collect(frozen, "0/2")
    collect(other, "1/2")
    shutil.copytree(other / SLICES, frozen / SLICES, dirs_exist_ok=True)
    with pytest.raises(DatasetError, match=r"1-of-2: was collected with another plan"):
        join(frozen)


def test_a_full_disk_ends_the_attempt_and_a_later_one_goes_on_with_its_episodes(
    frozen: Path, whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = True

    def append(self: OpenShard, episode: Episode) -> None:
        if full and len(self._runs) == 1:
            raise unwritable(self.part, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
        appended(self, episode)

    appended = OpenShard.append
    monkeypatch.setattr(OpenShard, "append", append)
    with pytest.raises(DatasetError, match=r"No space left on device[\s\S]*free space"):
        collect_slice(frozen, Slice(0, 2), overrides=INPROCESS)
    assert not find_finished(frozen)
    full = False
    reporter = Listener()
    collect_slice(frozen, Slice(0, 2), overrides=INPROCESS, reporter=reporter)
    assert any("keeps 1 episode of an earlier collection" in line for line in reporter.lines)
    collect(frozen, "1/2")
    join(frozen)
    assert fingerprints(frozen) == fingerprints(whole)


def test_a_slice_with_a_lost_trial_keeps_its_others_for_the_next_attempt(
    frozen: Path, whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin, refused, begun = Simulator.begin, True, set[int]()

    def begin_or_refuse(self: Simulator, trial: int, values: Mapping[str, float], **further: Any) -> None:
        if trial == 1 and refused:
            raise ThrowcollectError("no")
        begun.add(trial)
        begin(self, trial, values, **further)

    monkeypatch.setattr(Simulator, "begin", begin_or_refuse)
    with pytest.raises(LossError):
        collect_slice(frozen, Slice(0, 2), overrides=INPROCESS)
    refused = False
    begun.clear()
    collect_slice(frozen, Slice(0, 2), overrides=INPROCESS)
    assert begun == {1}
    collect(frozen, "1/2")
    join(frozen)
    assert fingerprints(frozen) == fingerprints(whole)
