"""The file by which a health check sees that the loop of a node goes round."""

from pathlib import Path

import pytest

from throwcollect.own_process import HEARTBEAT_VARIABLE, Heartbeat


def test_a_loop_that_goes_round_often_touches_its_file_once_a_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "alive"
    monkeypatch.setenv(HEARTBEAT_VARIABLE, str(file))
    heart = Heartbeat()
    heart.beat()
    file.unlink()
    heart.beat()
    assert not file.exists()


def test_outside_of_containers_a_heartbeat_writes_no_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(HEARTBEAT_VARIABLE, raising=False)
    Heartbeat().beat()
