"""The Fast DDS profiles of a run, and its discovery server."""

import re
import stat
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest

from throwcollect.errors import ConfigError
from throwcollect.ros.fast_dds import client_profile, server_profile, write_temporarily
from throwcollect.ros.router import discovery_server, router

ENDPOINT = "udp/127.0.0.1:7447"


class Profile:
    def __init__(self, text):
        self._root = ET.fromstring(text)  # noqa: S314 - our own

    def __call__(self, tag):
        return [(each.text or "").strip() for each in self._root.iter() if each.tag.rpartition("}")[2] == tag]


def test_the_profile_of_a_node_names_one_discovery_server():
    profile = Profile(client_profile(ENDPOINT))
    assert profile("discoveryProtocol") == ["SUPER_CLIENT"]
    assert profile("port") == ["7447"]
    assert profile("address") == ["127.0.0.1", "127.0.0.1"]
    assert profile("type") == ["UDPv4"]
    assert profile("useBuiltinTransports") == ["false"]


def test_the_profile_of_the_discovery_server_has_the_given_port():
    profile = Profile(server_profile(ENDPOINT))
    assert profile("discoveryProtocol") == ["SERVER"]
    assert profile("port") == ["7447"]
    (remote,) = re.findall('RemoteServer prefix="(.*?)"', client_profile(ENDPOINT))
    assert profile("prefix") == [remote]


def test_nodes_listen_everywhere_unless_the_endpoint_is_on_loopback():
    assert Profile(client_profile(ENDPOINT))("interfaceWhiteList")
    assert not Profile(client_profile("udp/192.0.2.7:7447"))("interfaceWhiteList")


def test_a_temporary_profile_is_private_and_removed_with_the_process():
    program = (
        "from throwcollect.ros.fast_dds import write_temporarily; import os, stat\n"
        "path = write_temporarily('<ä/>')\n"
        "print(path, oct(stat.S_IMODE(os.stat(path).st_mode)), path.read_text(encoding='utf-8'))"
    )
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    path, mode, content = said.split()
    assert (mode, content) == ("0o600", "<ä/>")
    assert not re.search(r"[^\w/.-]", path)
    with pytest.raises(FileNotFoundError):
        open(path).close()
    assert stat.S_IMODE(write_temporarily("").stat().st_mode) == 0o600


@pytest.fixture
def program(monkeypatch, tmp_path):
    """Puts a script in the place of the program of Fast DDS."""

    def put(script):
        path = tmp_path / "bin" / "fast-discovery-server"
        path.parent.mkdir()
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)
        monkeypatch.setattr("sys.prefix", str(tmp_path))

    return put


def test_a_discovery_server_on_a_busy_port_is_refused(program):
    program("exit 1")
    with (
        router("tcp/127.0.0.1:0") as taken,
        pytest.raises(ConfigError, match=r"cannot listen on udp/.*: Address already in use"),
        discovery_server(taken.replace("tcp", "udp")),
    ):
        pass
