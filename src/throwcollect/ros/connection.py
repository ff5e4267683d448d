"""The way into the ROS graph of one run, as a value, so that a program may have several at once, and its errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from rclzenoh.exceptions import ConfigurationError, NoRouterError
from rclzenoh.session_config import DOMAIN_VARIABLE, OVERRIDE_VARIABLE, client_override
from throwcollect.errors import ConfigError, UnreachableError
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import KEY_VARIABLE, RunKey

_EMBEDDED = Middleware()


@dataclass(frozen=True)
class Connection:
    """The way into the ROS graph of a run; `throwcollect.ros.init` takes it.

    A context that is initialised with one takes nothing from the environment. On the embedded backend, and on genuine
    rclpy with rmw_zenoh_cpp, contexts of one process may be in different runs. On Fast DDS a process is in one run, as
    Fast DDS reads only once which discovery server it uses.

    Attributes:
        endpoint: Endpoint of the router, such as ``tls/127.0.0.1:7447``.
        key: Key of the run; a router at ``tls/...`` rejects processes without it.
        domain_id: ROS domain.
        middleware: The middleware that carries the messages of the run.
    """

    endpoint: str
    key: RunKey
    domain_id: int = 0
    middleware: Middleware = _EMBEDDED

    def environment(self) -> Mapping[str, str]:
        """Environment variables by which our processes join the run; they name the key's files and hold no secret."""
        return {
            **self.middleware.environment(),
            OVERRIDE_VARIABLE: client_override(self.endpoint, self.key),
            DOMAIN_VARIABLE: str(self.domain_id),
            KEY_VARIABLE: str(self.key.directory),
        }

    def check(self, rmw: str) -> None:
        """Refuse to join the run by an RMW that its nodes do not understand."""
        if self.middleware.rmw != rmw:
            raise ConfigError(
                f"the run at {self.endpoint} is on {self.middleware.rmw}, and this process on {rmw}",
                hint="join it from a process of its own",
            )


@contextmanager
def zenoh_errors() -> Iterator[None]:
    """Raise errors about a session as errors of throwcollect."""
    try:
        yield
    except ConfigurationError as error:
        raise ConfigError(str(error)) from error
    except NoRouterError as error:
        raise UnreachableError(
            str(error),
            evidence=error.reason,
            hint="start a router: throwcollect router, or ros2 run rmw_zenoh_cpp rmw_zenohd; "
            f"or name another one in {OVERRIDE_VARIABLE}",
        ) from error
