"""Restrictions for processes of tests that root has started."""

from __future__ import annotations

import ctypes
import resource
from dataclasses import dataclass

_PR_CAPBSET_DROP = 24
_CLONE_NEWNET = 0x40000000
_VERSION_3 = 0x20080522
_OVERRIDES = (1, 2)
"""CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH: the rights to ignore permissions."""


@dataclass(frozen=True)
class Restrictions:
    """Restrictions that a process and all that it starts have from their beginning.

    Attributes:
        file_bytes: Most bytes of each file that is written, as if the disk were full then; None for any number.
        obeys_permissions: Whether permissions hold as for everybody who is not root.
        network: Name of a network namespace, outside of which nothing is reached; None for the machine's network.
    """

    file_bytes: int | None = None
    obeys_permissions: bool = False
    network: str | None = None

    def impose(self) -> None:
        """Restrict this process.

        Raises:
            OSError: If the system refuses.
        """
        if self.file_bytes is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (self.file_bytes, self.file_bytes))
        if self.obeys_permissions:
            _drop_overrides()
        if self.network is not None:
            with open(f"/run/netns/{self.network}") as namespace:
                if ctypes.CDLL(None, use_errno=True).setns(namespace.fileno(), _CLONE_NEWNET):
                    raise OSError(ctypes.get_errno(), "setns")


FREE = Restrictions()


def _drop_overrides() -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    header = (ctypes.c_uint32 * 2)(_VERSION_3, 0)
    # Effective, permitted and inheritable rights; then the same once more, for those with higher numbers.
    rights = (ctypes.c_uint32 * 6)()
    if libc.capget(header, rights):
        raise OSError(ctypes.get_errno(), "capget")
    for right in _OVERRIDES:
        # Programs that are started from here are given what is left in this set.
        libc.prctl(_PR_CAPBSET_DROP, right, 0, 0, 0)
        for kind in range(3):
            rights[kind] &= ~(1 << right)
    if libc.capset(header, rights):
        raise OSError(ctypes.get_errno(), "capset")
