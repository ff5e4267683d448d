"""Turns errors of `rclzenoh` into errors of throwcollect."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rclzenoh.exceptions import ConfigurationError, NoRouterError, UnreadableKeyError
from rclzenoh.session_config import OVERRIDE_VARIABLE
from throwcollect.errors import ConfigError, UnreachableError
from throwcollect.run_key import unreadable_key


@contextmanager
def zenoh_errors() -> Iterator[None]:
    """Raise errors about a session as errors of throwcollect."""
    try:
        yield
    # This error is handled before `ConfigurationError`, because it is derived from that.
    except UnreadableKeyError as error:
        raise unreadable_key(error.path, error.reason) from error
    except ConfigurationError as error:
        raise ConfigError(error.message, expected=error.expected) from error
    except NoRouterError as error:
        raise UnreachableError(
            error.message,
            evidence=error.reason,
            hint="start a router: python -m throwcollect.ros.router, or ros2 run rmw_zenoh_cpp rmw_zenohd; "
            f"or name another one in {OVERRIDE_VARIABLE}",
        ) from error
