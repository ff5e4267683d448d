import signal
import subprocess
import sys

import pytest

from throwcollect.errors import ConfigError
from throwcollect.ros.router import router

COMMAND = [sys.executable, "-m", "throwcollect.ros.router", "--listen"]


def test_a_busy_port_is_one_clear_error(endpoint):
    with (
        pytest.raises(ConfigError, match=f"cannot listen on {endpoint}: Address already in use\n") as caught,
        router(endpoint),
    ):
        pass
    assert ".rs" not in str(caught.value)
    assert "tcp/127.0.0.1:0" in caught.value.expected


@pytest.mark.parametrize(
    ("listen", "reason"),
    [
        ("nonsense", "Endpoints must be of the form"),
        ("tcp/nowhere.invalid:0", "cannot listen on"),
        ("tcp/" + 70 * "x" + ":0", "cannot listen on"),
        ("tcp/127.0.0.1:99999", "invalid port value\n"),
    ],
)
def test_an_endpoint_that_is_none_is_refused(listen, reason):
    with pytest.raises(ConfigError, match=reason) as caught, router(listen):
        pass
    assert ".rs" not in str(caught.value)


@pytest.mark.parametrize("stop", [signal.SIGTERM, signal.SIGINT])
def test_the_command_says_where_it_listens_and_stops_when_told(stop):
    process = subprocess.Popen([*COMMAND, "tcp/127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline().startswith("router listening on tcp/127.0.0.1:")
    process.send_signal(stop)
    assert process.wait(10) == 0


def test_the_command_reports_a_busy_port(endpoint):
    ended = subprocess.run([*COMMAND, endpoint], capture_output=True, text=True, timeout=20, check=False)
    assert ended.returncode == 2
    assert ended.stderr.startswith(f"the router cannot listen on {endpoint}")
