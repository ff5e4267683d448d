"""Finds runtimes by name, and chooses that of a run; other packages may add members of the family ``runtimes``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from throwcollect.collect.runtimes.runtime import Runtime
from throwcollect.errors import ConfigError, Problem, WorkerError
from throwcollect.extras import MissingExtraError, explain_missing
from throwcollect.members import load_member, names_of
from throwcollect.ros.middleware import Middleware, choose_middleware
from throwcollect.wording import suggest

if TYPE_CHECKING:
    # Records of runs import this module, and should not wait for this import.
    from throwcollect.config.schema import Config

AUTOMATIC = ("docker", "local")
"""The runtimes that ``auto`` tries, in this order."""


def get_runtime(name: str) -> Runtime:
    """Make the runtime of this name."""
    if name not in names_of("runtimes"):
        meant = suggest(name, names_of("runtimes"))
        raise ConfigError([Problem(f"there is no runtime {name}{meant}", key="run.runtime")])
    with explain_missing():
        runtime: Runtime = load_member("runtimes", name)()
    return runtime


def find_runtime(name: str) -> Runtime | None:
    """Make the runtime of this name; None if it cannot be used here, as it or a package that it needs is missing.

    This is for runs that are only looked at: other machines, or packages that were removed, may have begun them.
    """
    try:
        return get_runtime(name)
    except (ConfigError, MissingExtraError):
        return None


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
        say(f"runtime: {runtime.describe(config)}{rclpy}{note}")
        return RuntimeChoice(name, runtime, middleware)

    # Simulations of other machines can join a run only if its nodes are processes.
    wanted = config.run.runtime if config.run.listen is None else "local"
    *others, last = candidates = AUTOMATIC if wanted == "auto" else (wanted,)
    note = " (auto)" if candidates == AUTOMATIC else ""
    for name in others:
        try:
            return prepare(name, note)
        except MissingExtraError as error:
            note = f" (auto, as the package {error.package} is not installed)"
        except WorkerError as error:
            note = f" (auto, as {error.message})"
    return prepare(last, note)
