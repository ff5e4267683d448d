"""What this machine can do for a collection, in plain words."""

from __future__ import annotations

import os
import shutil
import socket
import sys
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from docker.errors import ImageNotFound

from throwcollect import ros_installation
from throwcollect.errors import ConfigError, WorkerError
from throwcollect.robots.model import half_sitting, joint_limits, urdf_path
from throwcollect.runtime.docker_engine import connect, engine_address, engine_errors
from throwcollect.runtime.image import default_tag, is_outdated
from throwcollect.wording import counted, listed

_GIB = 1024**3
_SIMULATION_MEMORY_GIB = 0.3
"""Resident memory of one simulation, generously."""

_ROS_ROUTER_PORT = 7447
"""Port where ROS 2 nodes on rmw_zenoh_cpp look for a router."""

_LEAST_DISK_GIB = 1.0
_ENGINE_S = 3.0


@dataclass(frozen=True)
class Check:
    """One finding about the machine.

    Attributes:
        name: What was looked at.
        status: `ok`, `note` (collections run, with a restriction), or `problem` (they do not).
        finding: What was found and what follows from it.
    """

    name: str
    status: Literal["ok", "note", "problem"]
    finding: str


def _python() -> Check:
    found = ".".join(map(str, sys.version_info[:3]))
    if not (3, 10) <= sys.version_info[:2] <= (3, 11):
        lacking = find_spec("pybullet") is None
        return Check("python", "problem" if lacking else "note", f"{found}; pybullet has wheels for 3.10 and 3.11")
    return Check("python", "ok", found)


def _cores() -> Check:
    cores = len(os.sched_getaffinity(0))
    return Check("cores", "ok", f"{cores}; up to {counted(cores, 'simulation')} side by side (`-n {cores}`)")


def _memory() -> Check:
    for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
        if line.startswith("MemAvailable:"):
            available = int(line.split()[1]) * 1024 / _GIB
            room = int(available / _SIMULATION_MEMORY_GIB)
            status: Literal["ok", "problem"] = "ok" if room >= 1 else "problem"
            return Check("memory", status, f"{available:.1f} GiB available, enough for {counted(room, 'simulation')}")
    return Check("memory", "note", "/proc/meminfo does not say what is available")


def _pybullet() -> Check:
    if find_spec("pybullet") is None:
        return Check("pybullet", "problem", "not installed; try: pip install pybullet==3.2.7")
    return Check("pybullet", "ok", version("pybullet"))


def _robot() -> Check:
    try:
        joint_limits()
        half_sitting()
        return Check("robot", "ok", f"Talos of example-robot-data {version('example-robot-data')}, {urdf_path()}")
    except PackageNotFoundError as error:
        return Check("robot", "problem", str(error))
    except ConfigError as error:
        return Check("robot", "problem", "; try: ".join(filter(None, [error.message, error.hint])))


def _docker() -> Check:
    try:
        with closing(connect(timeout_s=_ENGINE_S)) as client, engine_errors("the Docker engine fails"):
            engine = client.version()["Version"]
            found = f"Docker {engine} answers at {engine_address()}"
            try:
                client.images.get(default_tag())
            except ImageNotFound:
                lacking = f"the image {default_tag()} is not there yet; throwcollect image build makes it"
                return Check("docker", "note", f"{found}; {lacking}")
            if is_outdated(client, default_tag()):
                old = f"the image {default_tag()} was made from other sources than these"
                return Check("docker", "note", f"{found}; {old}; throwcollect image build makes it anew")
    except WorkerError as error:
        return Check("docker", "note", f"{error.message}; runs use processes")
    return Check("docker", "ok", f"{found}, with the image {default_tag()}")


def _port() -> Check:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", _ROS_ROUTER_PORT))
        except OSError as error:
            return Check(
                "ports", "note", f"{_ROS_ROUTER_PORT} is taken ({error.strerror}); runs use a free port by default"
            )
    return Check("ports", "ok", f"{_ROS_ROUTER_PORT}, where ROS nodes look for a router, is free")


def _rclpy() -> Check:
    lacking = ros_installation.missing()
    if "rclpy" in lacking:
        return Check("rclpy", "note", f"not installed; to have it: {ros_installation.how_to_install()}")
    rmws = listed(ros_installation.rmws()) or "no RMW"
    found = f"{ros_installation.rclpy_version() or 'of unknown version'} with {rmws}"
    if lacking:
        return Check("rclpy", "note", f"{found}, without {listed(lacking)}; try: {ros_installation.how_to_install()}")
    return Check("rclpy", "ok", f"{found} and all interfaces")


def _embedded() -> Check:
    found = f"Zenoh {version('eclipse-zenoh')}"
    try:
        # Its package loads the backend that is chosen.
        from throwcollect.ros.backend import VARIABLE, uses_rclpy

        chosen = "rclpy" if uses_rclpy() else "the embedded backend"
    except ConfigError as error:
        return Check("embedded", "problem", f"{found}; {'; try: '.join(filter(None, [error.message, error.hint]))}")
    except ImportError as error:
        return Check("embedded", "problem", f"{found}, but rclpy is chosen and cannot be imported: {error}")
    value = os.environ.get(VARIABLE)
    return Check("embedded", "ok", f"{found}; nodes run on {chosen}, as {VARIABLE} is {value or 'not set'}")


def _disk(directory: Path) -> Check:
    free = shutil.disk_usage(directory).free / _GIB
    status: Literal["ok", "problem"] = "ok" if free >= _LEAST_DISK_GIB else "problem"
    return Check("disk", status, f"{free:.1f} GiB free in {directory}")


def examine(directory: Path) -> list[Check]:
    """Look at everything a collection needs.

    Args:
        directory: Where datasets would be written.

    Returns:
        The findings, in a fixed order.
    """
    checks: list[Callable[[], Check]] = [_python, _cores, _memory, _pybullet, _robot, _rclpy, _embedded, _docker, _port]
    return [*(check() for check in checks), _disk(directory)]
