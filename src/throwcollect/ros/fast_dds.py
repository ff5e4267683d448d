"""XML profiles by which nodes of genuine rclpy on Fast DDS find each other through a discovery server.

By itself DDS has all nodes of a network find each other by multicast, which is what nodes of an open run do. Other runs
have a discovery server, in the place of Zenoh's router and at an endpoint of the same form: nodes know its address and
nothing else, so runs do not see each other. Everything goes over UDP, without multicast and without shared memory,
which containers do not share.

The server keeps nobody out who knows the address: DDS Security is not compiled into the wheels of Fast DDS, and over
TLS, which was tried, one connection in ten was never made on a busy machine.

Source: documentation of Fast DDS 2.14, "XML profiles" and "Discovery Server".
"""

from __future__ import annotations

import atexit
import socket
import tempfile
from pathlib import Path

from throwcollect.errors import ConfigError
from throwcollect.ros.router_endpoint import split_address

PROFILE_VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
"""Environment variable that names the file with the profile of a process."""
PLAIN_DISCOVERY = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}
"""Environment variable that keeps rmw_fastrtps from adding ways of discovery of its own to those of the profile."""

_SERVER = "44.53.00.5f.45.50.52.4f.53.49.4d.41"
"""Identifier of a discovery server, by which its clients know it; Fast DDS's own tools take the same one."""
_LEASE_S, _ANNOUNCED_S = 10, 1
"""Times [s] after which a silent node or server counts as gone, and in which each announces itself. On a busy machine
they are silent for a while, and one that counts as gone by mistake is often not found again."""
SERVER_REST_S = 11.0
"""Time [s] after which a server that ended is started again. Nodes take one that comes back sooner for the old one,
which they have not missed yet: they do not announce themselves to it, and never hear of nodes that come later."""


def client_profile(endpoint: str) -> str:
    """The profile of a node that uses the discovery server at an endpoint like ``udp/127.0.0.1:7447``.

    Raises:
        ConfigError: If the endpoint has no address.
    """
    address, port = _place(endpoint)
    # A plain client would hear only of nodes with which it has topics in common, and the ROS graph would be full of
    # gaps.
    discovery = f"""<discoveryProtocol>SUPER_CLIENT</discoveryProtocol>
          <discoveryServersList><RemoteServer prefix="{_SERVER}"><metatrafficUnicastLocatorList>
            {_locator(address, port)}
          </metatrafficUnicastLocatorList></RemoteServer></discoveryServersList>"""
    return _profile(address, discovery)


def server_profile(endpoint: str) -> str:
    """The profile of the discovery server itself; errors are those of `client_profile`."""
    address, port = _place(endpoint)
    locators = f"<metatrafficUnicastLocatorList>{_locator(address, port)}</metatrafficUnicastLocatorList>"
    return _profile(address, "<discoveryProtocol>SERVER</discoveryProtocol>", locators, f"<prefix>{_SERVER}</prefix>")


def write_temporarily(profile: str) -> Path:
    """Write a profile into a file that is deleted when this process ends."""
    # `mkstemp` makes a file that its owner alone can read.
    descriptor, name = tempfile.mkstemp(prefix="throwcollect-", suffix=".xml")
    with open(descriptor, "w", encoding="utf-8") as file:
        file.write(profile)
    path = Path(name)
    atexit.register(path.unlink, missing_ok=True)
    return path


def _place(endpoint: str) -> tuple[str, int]:
    """IPv4 address and port of an endpoint; its name is resolved here, as nodes pass the address on to others.

    Raises:
        ConfigError: If it is no address, or a name that nobody knows.
    """
    try:
        host, port = split_address(endpoint)
        return socket.gethostbyname(host), port
    except (OSError, UnicodeError, ValueError) as error:
        raise ConfigError(f"{endpoint}: no address of a discovery server: {error}") from error


def _locator(address: str, port: int) -> str:
    return f"<locator><udpv4><address>{address}</address><port>{port}</port></udpv4></locator>"


def _profile(address: str, discovery: str, locators: str = "", prefix: str = "") -> str:
    # Nodes of a run on one machine must not be reachable from others.
    loopback = f"<interfaceWhiteList><address>{address}</address></interfaceWhiteList>"
    return f"""<?xml version="1.0" encoding="UTF-8" ?>
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <profiles>
    <transport_descriptors><transport_descriptor>
      <transport_id>run</transport_id>
      <type>UDPv4</type>
      {loopback if address.startswith("127.") else ""}
    </transport_descriptor></transport_descriptors>
    <participant profile_name="throwcollect" is_default_profile="true"><rtps>
      {prefix}
      <useBuiltinTransports>false</useBuiltinTransports>
      <userTransports><transport_id>run</transport_id></userTransports>
      <builtin>
        <discovery_config>{discovery}
          <leaseDuration><sec>{_LEASE_S}</sec></leaseDuration>
          <leaseAnnouncement><sec>{_ANNOUNCED_S}</sec></leaseAnnouncement>
        </discovery_config>
        {locators}
      </builtin>
    </rtps></participant>
  </profiles>
</dds>
"""
