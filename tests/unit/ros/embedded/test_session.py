import pytest

from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.ros.embedded import session
from throwcollect.ros.embedded.session import open_session


def test_without_a_router_the_error_says_where_it_was_looked_for_and_what_to_do(environment, monkeypatch):
    monkeypatch.setattr(session, "_PATIENCE_S", 0.2)
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", 'connect/endpoints=["tcp/127.0.0.1:1"]')
    with pytest.raises(ThrowcollectError, match=r"connecting to .*tcp/127.0.0.1:1") as caught:
        open_session()
    assert "python -m throwcollect.ros.router" in caught.value.hint
    assert ".rs" not in caught.value.evidence


@pytest.mark.parametrize(
    ("override", "match"),
    [
        ("mode", "has no '='"),
        ('mode="nonsense"', r"mode cannot be \"nonsense\": unknown variant"),
        ("no/such/key=1", "no/such/key cannot be 1: unknown key$"),
    ],
)
def test_overrides_that_zenoh_does_not_understand_are_refused(environment, monkeypatch, override, match):
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", override)
    with pytest.raises(ConfigError, match=match):
        open_session()


def test_a_configuration_file_replaces_the_defaults(environment, endpoint, monkeypatch, tmp_path):
    path = tmp_path / "session.json5"
    path.write_text(
        f'{{mode: "peer", connect: {{endpoints: ["{endpoint}"]}}, scouting: {{multicast: {{enabled: false}}}}}}'
    )
    monkeypatch.setenv("ZENOH_SESSION_CONFIG_URI", str(path))
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", 'listen/endpoints=["tcp/127.0.0.1:0"]; ')
    opened = open_session()
    try:
        assert len(list(opened.info.routers_zid())) == 1
    finally:
        opened.close()


def test_a_configuration_file_that_is_none_is_refused(environment, monkeypatch, tmp_path):
    monkeypatch.setenv("ZENOH_SESSION_CONFIG_URI", str(tmp_path / "absent.json5"))
    with pytest.raises(ConfigError, match=r"ZENOH_SESSION_CONFIG_URI: .*absent.json5"):
        open_session()
