"""The options with which the containers of a run are made: names, labels, limits, mounts, environment."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from docker.types import DeviceRequest, EndpointConfig, LogConfig, Ulimit

from throwcollect.collect.runtimes.docker.docker_engine import default_tag
from throwcollect.collect.runtimes.nodes import (
    COORDINATOR,
    ROUTER,
    NodeSpec,
    choose_protocol,
    is_simulation,
    make_environment,
)
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.config.run import NodeContainerConfig
from throwcollect.config.schema import Config
from throwcollect.dataset.directory import DIRECTORY_VARIABLE
from throwcollect.dataset.provenance import HOST_VARIABLE, IMAGE_VARIABLE
from throwcollect.errors import ConfigError
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router_endpoint import LOOPBACK
from throwcollect.run_key import RunKey
from throwcollect.version import __version__

RUN_LABEL = "throwcollect.run"
NODE_LABEL = "throwcollect.node"
DIRECTORY_LABEL = "throwcollect.directory"
VERSION_LABEL = "throwcollect.version"
JOINED_LABEL = "throwcollect.joined"
"""Label with the id of the run that a component's container has joined, and with which it ends."""

ROUTER_PORT = 7447

DATA = "/data"
KEY = RunKey(Path("/key"))
"""The key of the run, as nodes in containers see it."""

API_VERSION = "1.41"
_PIDS = 512
_TMP = "/tmp"  # noqa: S108 - a file system of the container's own
_TMPFS = "rw,noexec,nosuid,size=64m"
_LOG_SIZE = {"max-size": "10m", "max-file": "2"}


def name_network(run: str) -> str:
    """Name of the network of a run."""
    return f"throwcollect-{run}"


def name_container(run: str, node: str) -> str:
    """Name of the container of a node."""
    return f"throwcollect-{run}-{node}"


def make_labels(record: RunRecord) -> dict[str, str]:
    """Labels of everything that is made for a run."""
    return {RUN_LABEL: record.run, DIRECTORY_LABEL: str(record.directory.resolve()), VERSION_LABEL: __version__}


def make_key_mount(key: RunKey) -> str:
    """The mount of the directory of a key, whose files only their owner can read.

    On hosts with SELinux, `z` gives it the label with which all containers may read it.
    """
    return f"{key.directory}:{KEY.directory}:ro,z"


def make_router_endpoint(config: Config, middleware: Middleware) -> str:
    """Zenoh endpoint of the router; by this name, the router listens only at its address in the run's network."""
    return f"{choose_protocol(config.run, middleware)}/{ROUTER}:{ROUTER_PORT}"


def choose_image(config: Config) -> str:
    """Image of all nodes."""
    return config.containers.image or default_tag()


def find_section(config: Config, name: str) -> NodeContainerConfig:
    """The section of the configuration for a node's container."""
    return config.containers.sim if is_simulation(name) else getattr(config.containers, name)


def publishes_port(config: Config) -> bool:
    """Whether a port is published to this machine, which is impossible from a network without a way out."""
    sections = (config.containers.router, config.containers.sim, config.containers.coordinator)
    return bool(config.run.router_port or any(section.ports for section in sections))


def make_node_options(
    node: NodeSpec, *, record: RunRecord, config: Config, image_id: str, address: str | None = None
) -> dict[str, Any]:
    """Keywords for `containers.create` that make the container of a node.

    The configuration may bind the node to another core. The id of the image goes into the dataset's provenance; the
    address is that in the run's network, None for any.
    """
    section, network = find_section(config, node.name), name_network(record.run)
    directory = str(record.directory.resolve())
    endpoint = make_router_endpoint(config, record.middleware)
    own = {
        **make_environment(Connection(endpoint, KEY, config.run.domain_id, record.middleware)),
        # Otherwise nodes would write a random id and /data into the provenance, which mean nothing outside.
        HOST_VARIABLE: socket.gethostname(),
        IMAGE_VARIABLE: image_id,
        DIRECTORY_VARIABLE: directory,
        "THROWCOLLECT_NODE": node.name,
    }
    mounts = [make_key_mount(record.key)]
    if node.name != ROUTER:
        mounts.append(f"{directory}:{DATA}:{'rw' if node.name == COORDINATOR else 'ro'},z")
    options = make_container_options(record, choose_image(config), node.name, section, environment=own, mounts=mounts)
    if node.name == ROUTER and config.run.router_port:
        options["ports"][f"{ROUTER_PORT}/tcp"] = (LOOPBACK, config.run.router_port)
    return {
        **options,
        "command": list(node.arguments),
        "network": network,
        "networking_config": {network: EndpointConfig(API_VERSION, aliases=[node.name], ipv4_address=address)},
        "cpuset_cpus": section.cpuset or (None if node.core is None else str(node.core)),
    }


def make_container_options(
    record: RunRecord,
    image: str,
    node: str,
    section: NodeContainerConfig,
    *,
    environment: Mapping[str, str],
    mounts: Sequence[str],
) -> dict[str, Any]:
    """Keywords for `containers.create` for a node or a component, which can do little but compute.

    Options of its section of the configuration, or of the catalogue, replace the general ones.
    """
    options: dict[str, Any] = dict(section.options)
    if "gpus" in options:
        options["device_requests"] = [DeviceRequest(count=options.pop("gpus"), capabilities=[["gpu"]])]
    chosen = {key: str(value) for key, value in section.environment.items()}
    return {
        "image": image,
        "user": f"{os.getuid()}:{os.getgid()}",
        # The kernel keeps signals without a handler from process 1, which also has to reap orphans. An init does both.
        "init": True,
        "read_only": True,
        "cap_drop": ["ALL"],
        "security_opt": ["no-new-privileges"],
        "pids_limit": _PIDS,
        "stop_signal": "SIGTERM",
        "log_config": LogConfig(type=LogConfig.types.JSON, config=_LOG_SIZE),
        **options,
        "name": name_container(record.run, node),
        "labels": {**options.get("labels", {}), **make_labels(record), NODE_LABEL: node},
        # Nothing but /tmp can be written in the container.
        "environment": {"HOME": _TMP, **chosen, **environment},
        "tmpfs": _join_tmpfs({_TMP: _TMPFS}, options.get("tmpfs", {})),
        "ulimits": [Ulimit(name=key, soft=value, hard=value) for key, value in options.get("ulimits", {}).items()],
        "volumes": _read_mounts([*mounts, *section.mounts]),
        "ports": {port: (LOOPBACK, host_port) for port, host_port in section.ports.items()},
        "nano_cpus": None if section.cpus is None else round(section.cpus * 10**9),
        "mem_limit": section.memory,
        # This limits memory and swap together; the same value as above leaves no swap.
        "memswap_limit": section.memory,
        "cpuset_cpus": section.cpuset,
    }


def _read_mounts(mounts: Sequence[str]) -> dict[str, dict[str, str]]:
    # The client takes a list of strings, too, but makes a volume of each whose mode it does not know.
    volumes: dict[str, dict[str, str]] = {}
    for mount in mounts:
        source, target, mode = f"{mount}:rw".split(":")[:3]
        if source in volumes:
            raise ConfigError(f"{source}: is mounted twice, at {volumes[source]['bind']} and {target}")
        volumes[source] = {"bind": target, "mode": mode}
    return volumes


def _join_tmpfs(own: Mapping[str, str], chosen: Mapping[str, str]) -> dict[str, str]:
    # The kernel takes the last of mount options that contradict each other.
    return {**own, **{path: ",".join(filter(None, [own.get(path), options])) for path, options in chosen.items()}}
