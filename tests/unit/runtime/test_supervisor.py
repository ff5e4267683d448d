import socket
from pathlib import Path

import pytest

from throwcollect.config.schema import RunConfig
from throwcollect.errors import ConfigError
from throwcollect.runtime.supervisor import Supervisor


def test_a_busy_port_is_refused_with_a_way_out(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=f"run.router_port: port {port} of 127.0.0.1 cannot be used") as caught:
            Supervisor(tmp_path / "data", RunConfig(router_port=port), simulations=1)
    assert caught.value.hint == "--set run.router_port=0 takes a free one"
    assert not (tmp_path / "data").exists()


def test_the_port_is_kept_until_the_router_needs_it(tmp_path: Path) -> None:
    with Supervisor(tmp_path, RunConfig(), simulations=1) as supervisor:
        port = int(supervisor.endpoint.rpartition(":")[2])
        with socket.socket() as other, pytest.raises(OSError, match="Address already in use"):
            other.bind(("127.0.0.1", port))
        assert not supervisor.router_answers()
    with socket.create_server(("127.0.0.1", port)):
        assert supervisor.router_answers()
