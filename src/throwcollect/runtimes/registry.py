"""Finds runtimes by name: they are members of the family ``runtimes``, to which other packages may add some."""

from __future__ import annotations

from throwcollect.errors import ConfigError, Problem
from throwcollect.extras import MissingExtraError, explain_missing
from throwcollect.members import load_member, names_of
from throwcollect.runtimes.runtime import Runtime
from throwcollect.wording import suggest

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
