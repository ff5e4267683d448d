"""The router and the protection that the environment configures for a session."""

from types import SimpleNamespace

import pytest

from rclzenoh.exceptions import ConfigurationError
from rclzenoh.session_config import (
    CONFIG_FILE_VARIABLE,
    OVERRIDE_VARIABLE,
    client_config,
    client_override,
    connect_endpoint,
    environment_config,
    is_protected,
    router_config,
)

ENDPOINT = "tls/127.0.0.1:7447"


@pytest.fixture(autouse=True)
def _nothing_said(monkeypatch):
    for variable in (CONFIG_FILE_VARIABLE, OVERRIDE_VARIABLE):
        monkeypatch.delenv(variable, raising=False)


@pytest.fixture
def key(tmp_path):
    made = SimpleNamespace(private_key=tmp_path / "key.pem", certificate=tmp_path / "certificate.pem")
    for path in (made.private_key, made.certificate):
        path.write_text("")
    return made


def test_an_empty_environment_names_no_router():
    assert connect_endpoint() is None


def test_the_router_comes_from_the_override_or_the_configuration_file(monkeypatch, key, tmp_path):
    monkeypatch.setenv(OVERRIDE_VARIABLE, client_override(ENDPOINT, key))
    assert connect_endpoint() == ENDPOINT
    monkeypatch.delenv(OVERRIDE_VARIABLE)
    (tmp_path / "session.json5").write_text('{mode: "client", connect: {endpoints: ["tcp/192.0.2.7:1"]}}')
    monkeypatch.setenv(CONFIG_FILE_VARIABLE, str(tmp_path / "session.json5"))
    assert connect_endpoint() == "tcp/192.0.2.7:1"


@pytest.mark.parametrize("make", [environment_config, lambda: client_config(ENDPOINT), lambda: router_config(ENDPOINT)])
def test_a_session_needs_no_shared_memory(make):
    assert make().get_json("transport/shared_memory/enabled") == "false"


def test_an_unreadable_key_is_an_error_that_names_it(key):
    key.certificate.unlink()
    with pytest.raises(ConfigurationError, match=f"cannot be read: {key.certificate}: No such file"):
        client_config(ENDPOINT, key)
    client_config("tcp/127.0.0.1:7447", key)


def test_a_client_listens_nowhere_whatever_the_configuration_file_says(monkeypatch, tmp_path):
    file = tmp_path / "session.json5"
    # These are defaults of rmw_zenoh_cpp.
    file.write_text('{mode: "peer", listen: {endpoints: ["tcp/localhost:0"]}}')
    monkeypatch.setenv(CONFIG_FILE_VARIABLE, str(file))
    monkeypatch.setenv(OVERRIDE_VARIABLE, client_override("tcp/192.0.2.7:1"))
    config = environment_config()
    assert (config.get_json("mode"), config.get_json("listen/endpoints")) == ('"client"', "[]")


@pytest.mark.parametrize("defaults", ["{}", '{mode: "peer", listen: {endpoints: ["tcp/localhost:0"]}}'])
def test_a_client_of_a_router_with_a_key_is_protected(monkeypatch, key, tmp_path, defaults):
    """This holds also for a configuration file with the defaults of rmw_zenoh_cpp, to which the override is applied."""
    (tmp_path / "session.json5").write_text(defaults)
    monkeypatch.setenv(CONFIG_FILE_VARIABLE, str(tmp_path / "session.json5"))
    monkeypatch.setenv(OVERRIDE_VARIABLE, client_override(ENDPOINT, key))
    assert is_protected()


@pytest.mark.parametrize(
    ("override", "protected"),
    [
        ("connect/endpoints=[];listen/endpoints=[]", False),
        ('connect/endpoints=["tls/192.0.2.7:1", "tcp/192.0.2.7:1"];listen/endpoints=[]', False),
        # Sessions of rmw_zenoh_cpp listen on this host unless their environment sets another list.
        ('mode="client";connect/endpoints=["tls/192.0.2.7:1"]', False),
        ('connect/endpoints=["tls/192.0.2.7:1"];listen/endpoints=["tcp/127.0.0.1:0"]', False),
        ('connect/endpoints=["tls/192.0.2.7:1"];listen/endpoints=["tls/127.0.0.1:0"]', True),
        ('connect/endpoints=["tls/192.0.2.7:1"];listen/endpoints=[]', True),
    ],
)
def test_a_session_is_protected_if_the_environment_sets_endpoints_of_tls_alone(override, protected, monkeypatch):
    monkeypatch.setenv(OVERRIDE_VARIABLE, override)
    assert is_protected() == protected
