import socket
import threading

import pytest
import zenoh

from rclzenoh import context
from rclzenoh.context import open_session
from rclzenoh.exceptions import NoRouterError
from rclzenoh.session_config import environment_config, router_config


def test_a_missing_router_is_an_error_that_names_the_endpoint(environment, monkeypatch):
    monkeypatch.setattr(context, "_PATIENCE_S", 0.2)
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", 'connect/endpoints=["tcp/127.0.0.1:1"]')
    with pytest.raises(NoRouterError, match=r"connecting to .*tcp/127.0.0.1:1") as caught:
        open_session(environment_config())
    assert ".rs" not in caught.value.reason


def test_a_session_waits_for_its_router_as_long_as_its_configuration_says(environment, monkeypatch):
    monkeypatch.setattr(context, "_PATIENCE_S", 0.0)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        unused = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", f'connect/endpoints=["{unused}"];connect/timeout_ms=20000')
    routers: list[zenoh.Session] = []
    late = threading.Timer(0.2, lambda: routers.append(zenoh.open(router_config(unused))))
    late.start()
    try:
        opened = open_session(environment_config())
        assert len(list(opened.info.routers_zid())) == 1
        opened.close()
    finally:
        late.join()
        routers[0].close()


def test_a_configuration_file_replaces_the_defaults(environment, endpoint, monkeypatch, tmp_path):
    path = tmp_path / "session.json5"
    path.write_text(
        f'{{mode: "peer", connect: {{endpoints: ["{endpoint}"]}}, scouting: {{multicast: {{enabled: false}}}}}}'
    )
    monkeypatch.setenv("ZENOH_SESSION_CONFIG_URI", str(path))
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", 'listen/endpoints=["tcp/127.0.0.1:0"]; ')
    opened = open_session(environment_config())
    try:
        assert len(list(opened.info.routers_zid())) == 1
    finally:
        opened.close()
