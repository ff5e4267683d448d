"""Names of nodes by which processes of ours look on or ask: hidden, and of one node each."""

from __future__ import annotations

import itertools
import os

_numbers = itertools.count()


def make_own_name() -> str:
    """A name that no other node has, of this process or another one of this machine."""
    return f"_throwcollect_{os.getpid()}_{next(_numbers)}"
