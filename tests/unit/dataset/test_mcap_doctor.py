"""Every record of a recording follows the MCAP specification, as checked with code of other packages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.unit.dataset.mcap_doctor import Examination

ALL_TOPICS = ["joint_states", "ball/odometry", "controller_state", "tf", "clock"]


def test_every_record_of_every_recording_is_sound(collected: Path) -> None:
    examined = [Examination(path) for path in sorted(collected.glob("*.mcap"))]
    assert [len(each.chunk_indexes) for each in examined] == [4, 4, 2]


def test_every_record_is_sound_when_all_topics_are_recorded(make_collection: Any, tmp_path: Path) -> None:
    settings = {"trials": 1, "record": {"topics": ALL_TOPICS}}
    make_collection(settings).collect(tmp_path / "full")
    examined = Examination(tmp_path / "full" / "quick_00000.mcap")
    assert sorted(examined.counts) == sorted(examined.channels)
    assert len(examined.channels) == 8
