"""Tells the process of a command of ours from that of another program that imports us.

A command may be forked, because its threads, files and settings are known. Those of another program are not, and a fork
of it would have them, too.
"""

from __future__ import annotations

import threading

_commands: list[bool] = []


def claim_process() -> None:
    """Declare that this process runs a command and nothing else."""
    _commands.append(True)


def may_be_forked() -> bool:
    """Whether this process runs a command, and has no other thread whose locks a fork would copy."""
    return bool(_commands) and threading.active_count() == 1
