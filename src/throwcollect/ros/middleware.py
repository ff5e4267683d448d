"""What carries the messages of a run: all its nodes have to agree on it, and so has everybody who joins."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from throwcollect.ros.backend import EMBEDDED_RMW, RMW_VARIABLE, VARIABLE, uses_rclpy

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
        """That of this process.

        Raises:
            ConfigError: If the environment asks for a backend that is not there.
        """
        if not uses_rclpy():
            return cls()
        return cls("rclpy", os.environ.get(RMW_VARIABLE) or _DEFAULT_RMW)

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
        """Make it that of this process, before anything of `throwcollect.ros` is imported.

        Raises:
            ConfigError: If the backend is not there.
        """
        os.environ.update(self.environment())
        uses_rclpy.cache_clear()
        uses_rclpy()


def wanted(backend: Literal["auto", "embedded", "rclpy"]) -> Middleware:
    """What a run is to have, and its launcher, too.

    Args:
        backend: What its configuration asks for; ``auto`` leaves it to the environment, and to what is installed.

    Raises:
        ConfigError: If the backend is not there.
    """
    if backend != "auto":
        os.environ[VARIABLE] = backend
        uses_rclpy.cache_clear()
    return Middleware.of_process()
