"""The file by which a health check sees that the loop of a node goes round."""

import os
import time
from pathlib import Path

import pytest

import throwcollect.ros.health_check as health
from rclzenoh.session_config import OVERRIDE_VARIABLE
from throwcollect.errors import ThrowcollectError
from throwcollect.heartbeat import SILENT_S, VARIABLE, Heartbeat, is_beating
from throwcollect.ros.middleware import Middleware


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "alive"))
    return tmp_path / "alive"


def test_a_recent_heartbeat_counts_as_beating(file: Path) -> None:
    assert not is_beating()
    Heartbeat().beat()
    assert is_beating()


def test_an_old_heartbeat_does_not_count_as_beating(file: Path) -> None:
    Heartbeat().beat()
    long_ago = time.time() - SILENT_S - 1
    os.utime(file, (long_ago, long_ago))
    assert not is_beating()


def test_a_loop_that_goes_round_often_touches_its_file_once_a_second(file: Path) -> None:
    heart = Heartbeat()
    heart.beat()
    file.unlink()
    heart.beat()
    assert not file.exists()


def test_outside_of_containers_a_heartbeat_writes_no_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    Heartbeat().beat()
    assert not is_beating()


def test_on_fast_dds_a_node_is_healthy_only_if_its_loop_beats(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Middleware, "of_process", lambda: Middleware("rclpy", "rmw_fastrtps_cpp"))
    with pytest.raises(ThrowcollectError, match="sim_0: does not answer"):
        health.check("sim_0")
    Heartbeat().beat()
    health.check("sim_0")


def test_on_fast_dds_a_missing_router_is_not_healthy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Middleware, "of_process", lambda: Middleware("rclpy", "rmw_fastrtps_cpp"))
    monkeypatch.setenv(OVERRIDE_VARIABLE, 'connect/endpoints=["udp/127.0.0.1:9"]')
    with pytest.raises(ThrowcollectError, match=r"router: no session with the router at udp/127\.0\.0\.1:9"):
        health.check("router")
