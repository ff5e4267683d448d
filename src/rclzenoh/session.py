"""Opens the Zenoh session of a context."""

from __future__ import annotations

import time

import zenoh

from rclzenoh.exceptions import NoRouterError
from rclzenoh.session_config import in_words

_PATIENCE_S, _RETRY_S = 5.0, 0.1


def open_session(config: zenoh.Config) -> zenoh.Session:
    """Open a session with a router, which may just be starting; the caller has to close it.

    Zenoh itself waits for a router only if the configuration has ``connect/timeout_ms``, which it lacks by default.

    Raises:
        NoRouterError: If there is no router within some seconds.
    """
    zenoh.try_init_log_from_env()  # type: ignore[no-untyped-call]
    begin = time.monotonic()
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            waited = time.monotonic() - begin
            if waited > _PATIENCE_S:
                raise NoRouterError(config.get_json("connect/endpoints"), round(waited, 1), in_words(error)) from error
            time.sleep(_RETRY_S)
