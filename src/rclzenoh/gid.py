"""Global identifiers of endpoints."""

from __future__ import annotations

from xxhash import xxh3_128_intdigest


def gid_of(token: str) -> bytes:
    """Identifier of the endpoint that a liveliness token announces.

    Args:
        token: The whole token.

    Returns:
        16 bytes: the token's XXH3-128 in little-endian order, as rmw_zenoh_cpp has it.
    """
    return xxh3_128_intdigest(token.encode()).to_bytes(16, "little")
