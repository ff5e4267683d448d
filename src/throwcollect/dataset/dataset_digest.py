"""The digest of a whole dataset."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

import numpy as np

from throwcollect.sweep.points import Targets


def combine_digests(digests: Iterable[str], targets: Targets | None) -> str:
    """Compute SHA-256 over the digests of all episodes in order of trials, each as 32 bytes; digests are hexadecimal.

    The targets of all trials follow, if trials have some, as no episode contains them: of each column its name, a zero
    byte, and the number of each trial as a little-endian double, the NaN 0x7ff8000000000000 where it has none.
    """
    combined = hashlib.sha256()
    for digest in digests:
        combined.update(bytes.fromhex(digest))
    for name, values in () if targets is None else zip(targets.names, targets.values.T, strict=True):
        combined.update(name.encode() + b"\0")
        combined.update(np.where(np.isnan(values), np.nan, values).astype("<f8").tobytes())
    return combined.hexdigest()
