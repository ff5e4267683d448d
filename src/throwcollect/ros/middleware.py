"""The middleware that carries the messages of a run; all its nodes and everybody who joins need the same one.

The environment of a process chooses it: ``THROWCOLLECT_ROS`` is ``auto``, ``rclpy`` or ``embedded``, and genuine rclpy
has its own variable for the RMW. A program that joins a run chooses it by `Middleware.settle` instead.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal

from throwcollect.errors import ConfigError
from throwcollect.ros_installation import HOW_TO_INSTALL, missing, rmws
from throwcollect.wording import join_names

VARIABLE = "THROWCOLLECT_ROS"
"""Name of the environment variable that chooses the backend."""
RMW_VARIABLE = "RMW_IMPLEMENTATION"
"""Name of the environment variable by which rclpy chooses its RMW."""
EMBEDDED_RMW = "rmw_zenoh_cpp"
"""The RMW whose wire protocol the embedded backend speaks."""

Backend = Literal["embedded", "rclpy"]

_DEFAULT_RMW = "rmw_fastrtps_cpp"
"""The default of Jazzy, and the only RMW in the wheels of rclpy."""


@dataclass(frozen=True)
class Middleware:
    """The middleware that carries the messages of a run.

    Attributes:
        backend: The library with which its nodes speak ROS 2.
        rmw: RMW of genuine rclpy; on the embedded backend, the RMW whose protocol that speaks.
    """

    backend: Backend = "embedded"
    rmw: str = EMBEDDED_RMW

    @classmethod
    def of_process(cls) -> Middleware:
        """The middleware of this process: the one that was settled on, or else the one that its environment chooses."""
        if _settled:
            return _settled[0]
        return _choose_installed(os.environ.get(VARIABLE) or "auto", os.environ.get(RMW_VARIABLE) or None)

    @property
    def is_fast_dds(self) -> bool:
        """Whether nodes find each other by a discovery server of Fast DDS, and not by a router of Zenoh."""
        return self.rmw.startswith("rmw_fastrtps")

    @property
    def keeps_others_out(self) -> bool:
        """Whether its router asks for the key of a run. Other middleware has no router, or a router without a key."""
        return self.rmw == EMBEDDED_RMW

    @property
    def joining(self) -> Middleware:
        """The middleware of our processes that are no nodes: the embedded backend, if the nodes' RMW understands it."""
        return Middleware() if self.rmw == EMBEDDED_RMW else self

    def environment(self) -> Mapping[str, str]:
        """Environment variables by which a process of ours uses this middleware."""
        if self.backend == "embedded":
            return {VARIABLE: self.backend}
        return {VARIABLE: self.backend, RMW_VARIABLE: self.rmw}

    def settle(self) -> None:
        """Make this the middleware of the process, whatever its environment names.

        Call it before the first name is taken from `throwcollect.ros`, as a process has one backend.
        """
        _settled[:] = [_choose_installed(self.backend, self.rmw if self.backend == "rclpy" else None)]


_settled: list[Middleware] = []
"""The middleware that this process has settled on; empty while its environment decides."""


def choose_middleware(backend: Literal["auto", "embedded", "rclpy"]) -> Middleware:
    """Choose the middleware of a run and of its launcher.

    Args:
        backend: The one that the configuration asks for; ``auto`` leaves it to the environment, and to the packages
            that are installed.
    """
    if backend == "auto":
        return Middleware.of_process()
    return _choose_installed(backend, os.environ.get(RMW_VARIABLE) or None)


def uses_rclpy() -> bool:
    """Whether nodes of this process run on genuine rclpy."""
    return Middleware.of_process().backend == "rclpy"


# This is cached because finding all interfaces takes milliseconds, and each name from `throwcollect.ros` needs it.
@cache
def _choose_installed(backend: str, rmw: str | None) -> Middleware:
    """Choose the requested middleware; ``auto`` is genuine rclpy, if Python finds it and all interfaces.

    With ``auto``, the embedded backend is chosen if rmw_zenoh_cpp is requested but not installed, because it speaks the
    same protocol.
    """
    if backend not in ("auto", "rclpy", "embedded"):
        raise ConfigError(f"{VARIABLE}: got {backend!r}", expected="auto, rclpy or embedded")
    if backend == "embedded":
        return Middleware()
    if lacking := missing():
        if backend == "auto":
            return Middleware()
        raise ConfigError(
            f"{VARIABLE} is rclpy, but Python does not find {join_names(lacking)}",
            hint=f"{HOW_TO_INSTALL}; or set it to embedded",
        )
    installed = rmws()
    if rmw is None or rmw in installed:
        return Middleware("rclpy", rmw or _DEFAULT_RMW)
    if backend == "auto" and rmw == EMBEDDED_RMW:
        return Middleware()
    raise ConfigError(
        f"{RMW_VARIABLE} is {rmw}, which is not installed",
        expected=join_names(installed, "or") or "an installed RMW",
        hint=f"unset {RMW_VARIABLE}, or set {VARIABLE}=embedded",
    )
