"""Runtimes by name: members of the family ``runtimes``, which other packages may add to."""

from __future__ import annotations

from throwcollect.errors import ConfigError, Problem
from throwcollect.extras import explain_missing
from throwcollect.members import load_member, names_of
from throwcollect.runtimes.runtime import Runtime
from throwcollect.wording import join_names

AUTOMATIC = ("docker", "local")
"""What ``auto`` tries, in this order."""


def get_runtime(name: str) -> Runtime:
    """The runtime of a name.

    Raises:
        ConfigError: If there is none, such as when a run was started with a package that has gone since.
        MissingExtraError: If it needs packages that are not installed.
    """
    if name not in names_of("runtimes"):
        problem = Problem(f"there is no runtime {name}", key="run.runtime")
        raise ConfigError([problem], expected=join_names(names_of("runtimes"), "or"))
    with explain_missing():
        runtime: Runtime = load_member("runtimes", name)()
    return runtime
