"""What carries the messages of a run: all its nodes have to agree on it, and so has everybody who joins.

What a process has is settled by its environment: ``THROWCOLLECT_ROS`` is ``auto``, ``rclpy`` or ``embedded``, and
genuine rclpy has its own variable for the RMW. A program that joins a run settles it by `Middleware.settle` instead.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal

from throwcollect.errors import ConfigError
from throwcollect.ros_installation import how_to_install, missing, rmws
from throwcollect.wording import join_names

VARIABLE = "THROWCOLLECT_ROS"
"""Name of the environment variable that chooses the backend."""
RMW_VARIABLE = "RMW_IMPLEMENTATION"
"""Name of the environment variable by which rclpy chooses what it talks through."""
EMBEDDED_RMW = "rmw_zenoh_cpp"
"""The RMW whose wire protocol the embedded backend speaks."""

Backend = Literal["embedded", "rclpy"]

_DEFAULT_RMW = "rmw_fastrtps_cpp"
"""That of Jazzy, and the one that the wheels of rclpy bring."""


@dataclass(frozen=True)
class Middleware:
    """What carries the messages of a run.

    Attributes:
        backend: What its nodes run on.
        rmw: Middleware of genuine rclpy; that which the embedded backend is understood by, if nodes run on that.
    """

    backend: Backend = "embedded"
    rmw: str = EMBEDDED_RMW

    @classmethod
    def of_process(cls) -> Middleware:
        """That of this process: the one it has settled on, or else the one that its environment asks for.

        Raises:
            ConfigError: If the environment asks for a backend that is not there.
        """
        if _settled:
            return _settled[0]
        return _choose_installed(os.environ.get(VARIABLE) or "auto", os.environ.get(RMW_VARIABLE) or None)

    @property
    def is_fast_dds(self) -> bool:
        """Whether nodes find each other by a discovery server of Fast DDS, and not by a router of Zenoh."""
        return self.rmw.startswith("rmw_fastrtps")

    @property
    def keeps_others_out(self) -> bool:
        """Whether its router asks for the key of a run; other middleware has none, or lets in whoever finds it."""
        return self.rmw == EMBEDDED_RMW

    @property
    def joining(self) -> Middleware:
        """What our own processes join with that are no nodes: the embedded backend, wherever that is understood."""
        return Middleware() if self.rmw == EMBEDDED_RMW else self

    def environment(self) -> Mapping[str, str]:
        """Environment variables by which a process of ours takes part."""
        if self.backend == "embedded":
            return {VARIABLE: self.backend}
        return {VARIABLE: self.backend, RMW_VARIABLE: self.rmw}

    def settle(self) -> None:
        """Make it that of this process, whatever its environment says.

        It has to be done before the first name is taken from `throwcollect.ros`, as a process has one backend.

        Raises:
            ConfigError: If the backend or its RMW is not there.
        """
        _settled[:] = [_choose_installed(self.backend, self.rmw if self.backend == "rclpy" else None)]


_settled: list[Middleware] = []
"""What this process has settled on; empty while its environment decides."""


def choose_middleware(backend: Literal["auto", "embedded", "rclpy"]) -> Middleware:
    """What a run is to have, and its launcher, too.

    Args:
        backend: What its configuration asks for; ``auto`` leaves it to the environment, and to what is installed.

    Raises:
        ConfigError: If the backend is not there.
    """
    if backend == "auto":
        return Middleware.of_process()
    return _choose_installed(backend, os.environ.get(RMW_VARIABLE) or None)


def uses_rclpy() -> bool:
    """Whether nodes of this process run on genuine rclpy.

    Raises:
        ConfigError: If the environment asks for a backend that is not there.
    """
    return Middleware.of_process().backend == "rclpy"


# To look for all interfaces takes milliseconds, and every name of `throwcollect.ros` asks.
@cache
def _choose_installed(backend: str, rmw: str | None) -> Middleware:
    """The middleware that is asked for: genuine rclpy by default, if Python finds it and all interfaces.

    By default it is not taken where rmw_zenoh_cpp is asked for and ROS does not have it: the embedded backend speaks as
    that does.

    Raises:
        ConfigError: If there is no such backend, or rclpy is asked for and is not there or lacks interfaces, or there
            is no such RMW.
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
            hint=f"{how_to_install()}; or set it to embedded",
        )
    installed = rmws()
    if rmw is None or rmw in installed:
        return Middleware("rclpy", rmw or _DEFAULT_RMW)
    # The embedded backend speaks the protocol of that RMW, so nodes of both meet.
    if backend == "auto" and rmw == EMBEDDED_RMW:
        return Middleware()
    raise ConfigError(
        f"{RMW_VARIABLE} is {rmw}, which is not installed",
        expected=join_names(installed, "or") or "an installed RMW",
        hint=f"unset {RMW_VARIABLE}, or set {VARIABLE}=embedded",
    )
