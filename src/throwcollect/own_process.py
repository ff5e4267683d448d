"""Whether this process is that of a command of ours, or of somebody's program that has imported us.

What a command holds is known: it may be forked where others may not, as threads, files and settings of a stranger would
be in the copy, too.
"""

from __future__ import annotations

import threading

_commands: list[bool] = []


def claim_process() -> None:
    """Say that this process runs a command and nothing else."""
    _commands.append(True)


def may_be_forked() -> bool:
    """Whether a copy of this process would hold nothing but what commands hold, and no lock of another thread."""
    return bool(_commands) and threading.active_count() == 1
