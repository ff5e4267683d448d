"""One hash for a whole dataset."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable


def combine_digests(digests: Iterable[str]) -> str:
    """SHA-256 over the digests of all episodes in order of trials, each as 32 bytes, in hexadecimal.

    Args:
        digests: Digests of the episodes, in hexadecimal.
    """
    combined = hashlib.sha256()
    for digest in digests:
        combined.update(bytes.fromhex(digest))
    return combined.hexdigest()
