"""The Zenoh session of a context: how it is opened."""

from __future__ import annotations

import time

import zenoh

from throwcollect.errors import ThrowcollectError
from throwcollect.ros.session_config import OVERRIDE_VARIABLE, client_config, in_words

_PATIENCE_S, _RETRY_S = 5.0, 0.1


def open_session() -> zenoh.Session:
    """Open the session that the environment asks for; by default, as client of the router on this host.

    Returns:
        The session, which the caller has to close.

    Raises:
        ConfigError: If an environment variable does not hold what it should.
        ThrowcollectError: If there is no router within some seconds.
    """
    zenoh.try_init_log_from_env()  # type: ignore[no-untyped-call]
    config = client_config()
    deadline = time.monotonic() + _PATIENCE_S
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            if time.monotonic() > deadline:
                endpoints = config.get_json("connect/endpoints")
                raise ThrowcollectError(
                    f"no Zenoh session within {_PATIENCE_S:g} s; connecting to {endpoints}",
                    evidence=in_words(error),
                    hint="start a router: python -m throwcollect.ros.router, or ros2 run rmw_zenoh_cpp rmw_zenohd; "
                    f"or name another one in {OVERRIDE_VARIABLE}",
                ) from error
            time.sleep(_RETRY_S)
