"""The file by which a health check sees that the loop of a node goes round."""

from pathlib import Path

import pytest

from throwcollect.heartbeat import VARIABLE, Heartbeat


def test_a_loop_that_goes_round_often_touches_its_file_once_a_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "alive"
    monkeypatch.setenv(VARIABLE, str(file))
    heart = Heartbeat()
    heart.beat()
    file.unlink()
    heart.beat()
    assert not file.exists()


def test_outside_of_containers_a_heartbeat_writes_no_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    Heartbeat().beat()
