"""The table of runtimes: those that come with the product, and those that other packages add."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points

from throwcollect.config.run import RUNTIMES
from throwcollect.errors import ConfigError, Problem
from throwcollect.extras import explain_missing
from throwcollect.runtimes.runtime import Runtime
from throwcollect.wording import listed

# Not among the entry points of this package, as those of an editable installation are as old as the installation.
_OWN = {
    name: EntryPoint(name, target, RUNTIMES)
    for name, target in {
        "docker": "throwcollect.runtimes.docker.runtime:DockerRuntime",
        "local": "throwcollect.runtimes.local:LocalRuntime",
        "inprocess": "throwcollect.runtimes.in_process:InProcessRuntime",
    }.items()
}
AUTOMATIC = ("docker", "local")
"""What ``auto`` tries, in this order."""


def runtime_names() -> list[str]:
    """Names of all runtimes that there are, those of this package first."""
    return [*_OWN, *sorted({point.name for point in entry_points(group=RUNTIMES)} - _OWN.keys())]


def get_runtime(name: str) -> Runtime:
    """The runtime of a name.

    Raises:
        ConfigError: If there is none.
        MissingExtraError: If it needs packages that are not installed.
    """
    points = [_OWN[name]] if name in _OWN else list(entry_points(group=RUNTIMES, name=name))
    if not points:
        problem = Problem(f"there is no runtime {name}", key="run.runtime")
        raise ConfigError([problem], expected=listed(runtime_names(), "or"))
    with explain_missing():
        runtime: Runtime = points[0].load()()
    return runtime
