"""Chooses the runtime of a run, and the middleware of its nodes."""

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
class RuntimeChoice:
    """The runtime of a run, by its name and as an object, and the middleware that carries the messages of its nodes."""

    name: str
    runtime: Runtime
    middleware: Middleware


def choose(config: Config, *, say: Callable[[str], None], warn: Callable[[str], None]) -> RuntimeChoice:
    """Choose the runtime that a configuration asks for, and make sure that it can be used.

    With ``auto``, nodes are containers if an engine for them is available. rclpy is used where it is installed. `say`
    gets a line for each step that takes long, such as pulling an image, and then the choice. `warn` gets a line for
    everything that may be wrong, such as an image that was made from other sources.
    """
    launcher = choose_middleware(config.run.ros)

    def prepare(name: str, note: str) -> RuntimeChoice:
        runtime = get_runtime(name)
        # A runtime imports the packages that only it needs when it is used.
        with explain_missing():
            middleware = runtime.prepare(config, launcher, say=say, warn=warn)
        rclpy = f" on genuine rclpy with {middleware.rmw}" if middleware.backend == "rclpy" else ""
        say(f"runtime: {runtime.in_words(config)}{rclpy}{note}")
        return RuntimeChoice(name, runtime, middleware)

    *others, last = candidates = _list_candidates(config)
    note = " (auto)" if candidates == AUTOMATIC else ""
    for name in others:
        try:
            return prepare(name, note)
        except MissingExtraError as error:
            note = f" (auto, as the package {error.package} is not installed)"
        except WorkerError as error:
            note = f" (auto, as {error.message})"
    return prepare(last, note)


def _list_candidates(config: Config) -> tuple[str, ...]:
    """Names of the runtimes that the run may have, in the order in which they are tried."""
    # Simulations of other machines can join a run only if its nodes are processes.
    name = config.run.runtime if config.run.listen is None else "local"
    return AUTOMATIC if name == "auto" else (name,)
