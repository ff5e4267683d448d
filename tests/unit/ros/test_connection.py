"""One process in several runs at once."""

import os

import pytest
from tests.contract.rig import names_of

from rclzenoh.session_config import CONFIG_FILE_VARIABLE, OVERRIDE_VARIABLE
from throwcollect import ros
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import VARIABLE
from throwcollect.ros.router import router
from throwcollect.run_key import KEY_VARIABLE, RunKey


@pytest.fixture
def key(tmp_path):
    made = RunKey(tmp_path / "key")
    made.create()
    return made


def test_the_environment_of_a_process_has_the_connection_but_no_secret(key):
    environment = Connection("tls/127.0.0.1:7447", key, 7).environment()
    assert environment[VARIABLE] == "embedded"
    assert (environment["ROS_DOMAIN_ID"], environment[KEY_VARIABLE]) == ("7", str(key.directory))
    assert 'connect/endpoints=["tls/127.0.0.1:7447"]' in environment[OVERRIDE_VARIABLE]
    assert str(key.private_key) in environment[OVERRIDE_VARIABLE]


def test_a_process_can_be_in_several_runs_whatever_its_environment_says(key, monkeypatch):
    for variable in (OVERRIDE_VARIABLE, CONFIG_FILE_VARIABLE, "ROS_DOMAIN_ID"):
        monkeypatch.setenv(variable, "nonsense")
    before = dict(os.environ)
    with router("tls/127.0.0.1:0", key) as private, router("tcp/127.0.0.1:0") as public:
        nodes = {}
        ways = {"private": Connection(private, key, 3), "public": Connection(public, key, 3)}
        try:
            for name, way in [*ways.items(), ("elsewhere", Connection(private, key, 4))]:
                context = ros.Context()
                ros.init(context=context, connection=way)
                nodes[name] = ros.Node(name, context=context)
            assert [nodes[name].context.get_domain_id() for name in nodes] == [3, 3, 4]
            for name, way in ways.items():
                # A node that comes later discovers those that are there already.
                context = ros.Context()
                ros.init(context=context, connection=way)
                seen = names_of(ros.Node("late", context=context))
                ros.shutdown(context=context)
                assert seen == sorted([name, "late"])
        finally:
            for node in nodes.values():
                ros.shutdown(context=node.context)
    assert dict(os.environ) == before
