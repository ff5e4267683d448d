"""The embedded backend: `rclzenoh`, which needs no installation of ROS 2."""

from __future__ import annotations

import rclzenoh.context
from rclzenoh import api
from rclzenoh.api import *  # noqa: F403
from rclzenoh.context import Context
from rclzenoh.session_config import client_config, is_protected
from throwcollect.ros.connection import Connection, zenoh_errors
from throwcollect.ros.middleware import EMBEDDED_RMW


def init(*, context: Context | None = None, connection: Connection | None = None) -> None:
    """Initialise a context.

    Args:
        context: The context; None for the default one.
        connection: The way into the graph; None for the one that the environment describes.
    """
    domain_id = config = None
    with zenoh_errors():
        if connection is not None:
            connection.check(EMBEDDED_RMW)
            domain_id = connection.domain_id
            config = client_config(connection.endpoint, connection.key)
        rclzenoh.context.init(context=context, domain_id=domain_id, config=config)


def joins_protected() -> bool:
    """Whether nodes of this process join a graph that rejects processes without a key."""
    with zenoh_errors():
        return is_protected()


__all__ = ["init", "joins_protected"]
__all__ += api.__all__
