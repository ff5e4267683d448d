"""The file of rounds beside a plan counts as part of it, even if its writer died."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import pytest
from tests.unit.sweep.own_plan import make_plan
from tests.unit.sweep.thrower import configuration

from throwcollect.errors import DatasetError
from throwcollect.sweep.plan import Plan
from throwcollect.sweep.round_file import append_round

CONFIG = configuration(trials=7, target=None)
WHOLE = make_plan(CONFIG, check=lambda config: "too short" if config.task.duration_s < 1.2 else None)
ROUNDS = (WHOLE.trials[:3], WHOLE.trials[3:5], WHOLE.trials[5:])


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The file of a plan with its first three trials; the other rounds lie beside it."""
    path = tmp_path / "plan.parquet"
    Plan(CONFIG, ROUNDS[0]).write(path)
    append_round(path, ROUNDS[1])
    append_round(path, ROUNDS[2])
    return path


def test_reading_a_plan_includes_the_file_of_rounds_beside_it(path: Path) -> None:
    assert 0 < len(WHOLE.trials[3:].refused) < 4
    plan = Plan.read(path, CONFIG)
    assert plan == WHOLE
    plan.take_in_rounds(path)
    assert os.listdir(path.parent) == ["plan.parquet"]
    assert path.read_bytes() == WHOLE.encode()
    assert Plan.read(path, CONFIG) == WHOLE


def test_a_round_that_was_cut_off_is_left_out(path: Path) -> None:
    rounds = path.with_name("plan.rounds.part")
    data = rounds.read_bytes()
    ends = [place for place, byte in enumerate(data, 1) if byte == ord("\n")]
    assert len(ends) == 2
    # Every cut around the end of a round is tested, and every tenth one within it.
    near = {end + by for end in ends for by in (-2, -1, 0, 1)}
    for size in sorted({*range(0, len(data), 10), *near} & {*range(len(data) + 1)}):
        rounds.write_bytes(data[:size])
        there = sum(size >= end for end in ends)
        assert len(Plan.read(path, CONFIG).trials) == (3, 5, 7)[there], size


def test_rounds_that_the_plan_file_has_already_are_left_out(path: Path) -> None:
    data = path.with_name("plan.rounds.part").read_bytes()
    WHOLE.write(path)
    path.with_name("plan.rounds.part").write_bytes(data)
    assert Plan.read(path, CONFIG) == WHOLE


@pytest.mark.parametrize(
    "change",
    [
        {"first": 4},
        {"first": 6},
        {"first": None},
        {"values": [[1.0, 2.0]]},
        {"seeds": [-1, 0]},
        {"seeds": []},
        {"digests": ["0", "1"]},
        {"digests": ["0" * 64]},
        {"refused": [None]},
    ],
)
def test_a_round_that_does_not_fit_the_plan_is_refused(path: Path, change: dict[str, object]) -> None:
    rounds = path.with_name("plan.rounds.part")
    first, second = rounds.read_bytes().splitlines(keepends=True)
    rounds.write_text(json.dumps(json.loads(first) | change) + "\n" + second.decode())
    with pytest.raises(DatasetError, match=r"plan\.rounds\.part: line 1: is damaged: no round of this plan"):
        Plan.read(path, CONFIG)
    rounds.write_bytes(b"[" * 100_000 + b"\n")
    with pytest.raises(DatasetError, match="is damaged: no round of this plan"):
        Plan.read(path, CONFIG)


def test_a_symbolic_link_in_place_of_the_file_of_rounds_is_not_followed(path: Path, tmp_path: Path) -> None:
    rounds = path.with_name("plan.rounds.part")
    rounds.rename(tmp_path / "elsewhere")
    rounds.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(DatasetError, match=r"plan\.rounds\.part: cannot be read: a symbolic link leads elsewhere"):
        Plan.read(path, CONFIG)
    with pytest.raises(DatasetError, match=r"plan\.rounds\.part: cannot be written: a symbolic link leads elsewhere"):
        append_round(path, ROUNDS[1])


def test_a_full_disk_loses_only_the_round_being_written(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path.with_name("plan.rounds.part").unlink()
    append_round(path, ROUNDS[1])
    write = os.write

    def write_half(descriptor: int, data: bytes) -> int:
        if len(data) < 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(descriptor, data[: len(data) // 2])

    monkeypatch.setattr("throwcollect.files.os.write", write_half)
    with pytest.raises(DatasetError, match=r"cannot be written: No space left on device\n  try: free space"):
        append_round(path, ROUNDS[2])
    assert Plan.read(path, CONFIG).trials == WHOLE.trials[:5]
