"""Which runtime a run has, and what carries its messages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from throwcollect.config.schema import Config
from throwcollect.errors import WorkerError
from throwcollect.extras import MissingExtraError, explain_missing
from throwcollect.ros.middleware import Middleware, choose_middleware
from throwcollect.runtimes.registry import AUTOMATIC, get_runtime
from throwcollect.runtimes.runtime import Runtime


@dataclass(frozen=True)
class Choice:
    """What has the trials of a run simulated, and what carries their messages.

    Attributes:
        name: Name of the runtime.
        runtime: The runtime.
        middleware: What carries the messages.
    """

    name: str
    runtime: Runtime
    middleware: Middleware


def begin(config: Config) -> Choice | None:
    """Have the runtime that a run will have begin what it can, if it can be seen at a glance which one that is.

    Returns:
        The runtime, for `choose`, to be closed whatever comes of it; None if there is none.

    Raises:
        ConfigError: If rclpy is asked for, and is not there, or there is no such runtime.
        MissingExtraError: If what the runtime needs is not installed.
    """
    middleware = choose_middleware(config.run.ros)
    for name in _candidates(config):
        runtime = get_runtime(name)
        if not runtime.is_absent():
            runtime.begin(config, middleware)
            return Choice(name, runtime, middleware)
    return None


def choose(
    config: Config, *, say: Callable[[str], None], warn: Callable[[str], None], begun: Choice | None = None
) -> Choice:
    """What a configuration asks for; with ``auto``, containers where they can be had, and rclpy where it is installed.

    Args:
        config: The configuration.
        say: Told in one line what was chosen, and before that what is done to get it.
        warn: Told in one line of what may not be as it should, such as an image that is not that of these sources.
        begun: What `begin` gave.

    Raises:
        ConfigError: If rclpy is asked for, and is not there, or there is no such runtime.
        MissingExtraError: If what the runtime needs is not installed.
        WorkerError: If the runtime that is asked for cannot be had.
    """
    launcher = choose_middleware(config.run.ros)
    candidates = _candidates(config)
    note = " (auto)" if candidates == AUTOMATIC else ""
    for name in candidates[:-1]:
        try:
            return _choose(_runtime(name, begun), name, config, launcher, note, say, warn)
        except MissingExtraError as error:
            note = f" (auto, as the package {error.package} is not installed)"
        except WorkerError as error:
            note = f" (auto, as {error.message})"
    return _choose(_runtime(candidates[-1], begun), candidates[-1], config, launcher, note, say, warn)


def _candidates(config: Config) -> tuple[str, ...]:
    """Names of the runtimes that may be had, in the order in which they are tried."""
    # Processes of other machines join processes.
    wanted = config.run.runtime if config.run.listen is None else "local"
    return AUTOMATIC if wanted == "auto" else (wanted,)


def _runtime(name: str, begun: Choice | None) -> Runtime:
    return begun.runtime if begun is not None and begun.name == name else get_runtime(name)


def _choose(
    found: Runtime,
    name: str,
    config: Config,
    launcher: Middleware,
    note: str,
    say: Callable[[str], None],
    warn: Callable[[str], None],
) -> Choice:
    # A runtime imports what only it needs when it is asked for.
    with explain_missing():
        middleware = found.prepare(config, launcher, say=say, warn=warn)
    rclpy = f" on genuine rclpy with {middleware.rmw}" if middleware.backend == "rclpy" else ""
    say(f"runtime: {found.in_words(config)}{rclpy}{note}")
    return Choice(name, found, middleware)
