"""Where the environment says that the router of a run is."""

import pytest

from throwcollect.errors import ConfigError
from throwcollect.ros.session_config import (
    CONFIG_FILE_VARIABLE,
    OVERRIDE_VARIABLE,
    client_override,
    connect_endpoint,
)
from throwcollect.run_key import RunKey

ENDPOINT = "tls/127.0.0.1:7447"


@pytest.fixture(autouse=True)
def _nothing_said(monkeypatch):
    for variable in (CONFIG_FILE_VARIABLE, OVERRIDE_VARIABLE):
        monkeypatch.delenv(variable, raising=False)


@pytest.fixture
def key(tmp_path):
    made = RunKey(tmp_path / "key")
    made.create()
    return made


def test_an_environment_that_says_nothing_of_a_router_leads_to_none():
    assert connect_endpoint() is None


def test_the_router_is_the_one_that_the_environment_names(monkeypatch, key, tmp_path):
    monkeypatch.setenv(OVERRIDE_VARIABLE, client_override(ENDPOINT, key))
    assert connect_endpoint() == ENDPOINT
    monkeypatch.delenv(OVERRIDE_VARIABLE)
    (tmp_path / "session.json5").write_text('{mode: "client", connect: {endpoints: ["tcp/192.0.2.7:1"]}}')
    monkeypatch.setenv(CONFIG_FILE_VARIABLE, str(tmp_path / "session.json5"))
    assert connect_endpoint() == "tcp/192.0.2.7:1"


def test_an_environment_with_no_router_at_all_leads_to_none(monkeypatch):
    monkeypatch.setenv(OVERRIDE_VARIABLE, "connect/endpoints=[]")
    assert connect_endpoint() is None


def test_an_environment_that_is_malformed_is_refused(monkeypatch):
    monkeypatch.setenv(OVERRIDE_VARIABLE, "connect/endpoints")
    with pytest.raises(ConfigError, match="has no '='"):
        connect_endpoint()
