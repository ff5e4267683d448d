"""XML profiles by which nodes of genuine rclpy on Fast DDS find each other through a discovery server.

By default, all nodes of a network on DDS find each other by multicast, as nodes of an open run do. Other runs have a
discovery server in place of Zenoh's router, at an endpoint of the same form. Nodes know only the address of that
server, so runs do not see each other. Everything goes over UDP, without multicast, and without shared memory, which
containers do not have in common.

The server lets everybody in who knows its address. DDS Security is not compiled into the wheels of Fast DDS. TLS was
tried, but on a busy machine, one connection in ten was never made.

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
"""Identifier by which clients know a discovery server; it is the one that Fast DDS's own tools use."""
_LEASE_S, _ANNOUNCED_S = 10, 1
"""Time [s] after which a silent node or server counts as gone, and time [s] between its announcements. On a busy
machine a node may be silent for a while, and if it counts as gone by mistake, others often do not find it again."""
SERVER_REST_S = 11.0
"""Time [s] after which a server that ended is started again. If it came back before nodes have noticed its end, they
would take it for the old server: they would not announce themselves to it, and never hear of later nodes."""


def client_profile(endpoint: str) -> str:
    """The profile of a node that uses the discovery server at an endpoint like ``udp/127.0.0.1:7447``."""
    address, port = _resolve_address(endpoint)
    # A plain client would only hear of nodes with which it has topics in common, so its ROS graph would be incomplete.
    discovery = f"""<discoveryProtocol>SUPER_CLIENT</discoveryProtocol>
          <discoveryServersList><RemoteServer prefix="{_SERVER}"><metatrafficUnicastLocatorList>
            {_locator(address, port)}
          </metatrafficUnicastLocatorList></RemoteServer></discoveryServersList>"""
    return _profile(address, discovery)


def server_profile(endpoint: str) -> str:
    """The profile of the discovery server itself; errors are those of `client_profile`."""
    address, port = _resolve_address(endpoint)
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


def _resolve_address(endpoint: str) -> tuple[str, int]:
    """IPv4 address and port of an endpoint; its name is resolved here, as nodes pass the address on to others."""
    try:
        host, port = split_address(endpoint)
        return socket.gethostbyname(host), port
    except (OSError, UnicodeError, ValueError) as error:
        raise ConfigError(f"{endpoint}: no address of a discovery server: {error}") from error


def _locator(address: str, port: int) -> str:
    return f"<locator><udpv4><address>{address}</address><port>{port}</port></udpv4></locator>"


def _profile(address: str, discovery: str, locators: str = "", prefix: str = "") -> str:
    # If the server is at a loopback address, nodes must not be reachable from other machines.
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
