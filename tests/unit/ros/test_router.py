import signal
import subprocess
import sys
import time

import pytest

from rclzenoh import context
from rclzenoh.session_config import OVERRIDE_VARIABLE, client_override, is_protected
from throwcollect import ros
from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.own_process import HEARTBEAT_VARIABLE
from throwcollect.ros.router import router
from throwcollect.run_key import RunKey

COMMAND = [sys.executable, "-m", "throwcollect", "router", "--listen"]


@pytest.mark.parametrize("stop", [signal.SIGTERM, signal.SIGINT])
def test_the_router_command_prints_its_endpoint_and_stops_on_a_signal(stop):
    process = subprocess.Popen([*COMMAND, "tcp/127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline().startswith("router listening on tcp/127.0.0.1:")
    process.send_signal(stop)
    assert process.wait(10) == 0


@pytest.fixture
def key(tmp_path):
    made = RunKey(tmp_path / "a key with ä")
    made.create()
    return made


def override_of(endpoint, key):
    return client_override(endpoint, key)


def test_a_protected_router_admits_only_clients_with_its_key(environment, rig, monkeypatch, key, tmp_path):
    stranger = RunKey(tmp_path / "stranger")
    stranger.create()
    monkeypatch.setattr(context, "_PATIENCE_S", 0.1)
    with router("tls/127.0.0.1:0", key) as endpoint:
        monkeypatch.setenv(OVERRIDE_VARIABLE, override_of(endpoint, key))
        assert is_protected()
        rig.context().shutdown()
        for override in (override_of(endpoint, stranger), override_of(endpoint.replace("tls", "tcp"), key)):
            monkeypatch.setenv(OVERRIDE_VARIABLE, override)
            with pytest.raises(ThrowcollectError, match="no Zenoh session") as caught:
                ros.init()
            assert "throwcollect router" in caught.value.hint
            assert ".rs" not in caught.value.evidence


def test_a_protected_router_needs_a_key_that_can_be_read(key):
    with pytest.raises(ConfigError, match=r"tls/127.0.0.1:\d+: no key is named") as caught, router("tls/127.0.0.1:0"):
        pass
    assert "--key DIR" in caught.value.expected
    key.private_key.unlink()
    with pytest.raises(ConfigError, match=r"cannot be read: .*/key.pem: No such file"), router("tls/127.0.0.1:0", key):
        pass


def test_the_router_command_makes_a_missing_key_and_keeps_an_existing_one(tmp_path):
    command = [*COMMAND, "tls/127.0.0.1:0", "--key", str(tmp_path / "new")]
    keys = []
    for _ in range(2):
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout.readline().startswith("router listening on tls/127.0.0.1:")
            process.terminate()
        keys.append(RunKey(tmp_path / "new").private_key.read_bytes())
    assert keys[0] == keys[1]


def test_a_running_router_keeps_renewing_its_heartbeat(tmp_path, monkeypatch):
    file = tmp_path / "alive"
    monkeypatch.setenv(HEARTBEAT_VARIABLE, str(file))
    with subprocess.Popen([*COMMAND, "tcp/127.0.0.1:0"], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline()
            for _ in range(2):
                deadline = time.monotonic() + 20
                while not file.exists():
                    assert time.monotonic() < deadline
                    time.sleep(0.02)
                file.unlink()
        finally:
            process.kill()
