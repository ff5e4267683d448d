"""Global identifiers of endpoints: XXH3-128 of their liveliness token.

References:
    xxHash specification, doc/xxhash_spec.md, "XXH3 Algorithm Overview" (default secret, seed 0).
"""

from __future__ import annotations

import struct

_SECRET = bytes.fromhex(
    "b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671fcb79e64eccc0e578825ad07dccff7221"
    "b8084674f743248ee03590e6813a264c3c2852bb91c300cb88d0658b1b532ea371644897a20df94e3819ef46a9deacd8"
    "a8fa763fe39c343ff9dcbbc7c70b4f1d8a51e04bcdb45931c89f7ec9d9787364eac5ac8334d3ebc3c581a0fffa1363eb"
    "170ddd51b7f0da49d316552629d4689e2b16be587d47a1fc8ff8b8d17ad031ce45cb3a8f95160428afd7fbcabb4b407e"
)
_MASK = 0xFFFFFFFFFFFFFFFF
_PRIME32 = (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D)
_PRIME64 = (0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5)
_SHORTEST, _SHORT, _MIDDLE = 17, 128, 240
_STRIPE, _BLOCK, _LAST_SECRET = 64, 1024, len(_SECRET) - 64


def gid_of(token: str) -> bytes:
    """Identifier of the endpoint that a liveliness token announces.

    Args:
        token: The whole token.

    Returns:
        16 bytes: the 128-bit hash in little-endian order, as rmw_zenoh_cpp has it.

    Raises:
        ValueError: If the token is shorter than any valid one.
    """
    return xxh3_128(token.encode()).to_bytes(16, "little")


def xxh3_128(data: bytes) -> int:
    """XXH3-128 with seed 0 of at least 17 bytes.

    Args:
        data: What to hash.

    Returns:
        The hash as an integer of 128 bits.

    Raises:
        ValueError: If there are fewer than 17 bytes, for which the algorithm is another one.
    """
    length = len(data)
    if length < _SHORTEST:
        raise ValueError(f"expected at least {_SHORTEST} bytes, got {length}")
    if length > _MIDDLE:
        return _hash_long(data)
    low, high = length * _PRIME64[0], 0
    if length <= _SHORT:
        for step in range((length - 1) // 32, -1, -1):
            low, high = _mix(low, high, data, 16 * step, length - 16 * (step + 1), 32 * step)
    else:
        for start in range(0, 128, 32):
            low, high = _mix(low, high, data, start, start + 16, start)
        low, high = _avalanche(low), _avalanche(high)
        for start in range(128, length // 32 * 32, 32):
            low, high = _mix(low, high, data, start, start + 16, start - 125)
        low, high = _mix(low, high, data, length - 16, length - 32, 103)
    first = _avalanche((low + high) & _MASK)
    second = -_avalanche((low * _PRIME64[0] + high * _PRIME64[3] + length * _PRIME64[1]) & _MASK) & _MASK
    return second << 64 | first


def _words(data: bytes, offset: int, count: int) -> tuple[int, ...]:
    return struct.unpack_from(f"<{count}Q", data, offset)


def _fold(a: int, b: int) -> int:
    product = a * b
    return (product ^ product >> 64) & _MASK


def _avalanche(value: int) -> int:
    value = (value ^ value >> 37) * 0x165667919E3779F9 & _MASK
    return value ^ value >> 32


def _mix(low: int, high: int, data: bytes, first: int, second: int, secret: int) -> tuple[int, int]:
    a, b = _words(data, first, 2)
    c, d = _words(data, second, 2)
    k0, k1, k2, k3 = _words(_SECRET, secret, 4)
    low = (low + _fold(a ^ k0, b ^ k1) & _MASK) ^ (c + d & _MASK)
    high = (high + _fold(c ^ k2, d ^ k3) & _MASK) ^ (a + b & _MASK)
    return low, high


def _accumulate(lanes: list[int], data: bytes, offset: int, secret: int) -> None:
    values, keys = _words(data, offset, 8), _words(_SECRET, secret, 8)
    for lane in range(8):
        mixed = values[lane] ^ keys[lane]
        lanes[lane ^ 1] += values[lane]
        lanes[lane] += (mixed & 0xFFFFFFFF) * (mixed >> 32)
    lanes[:] = [lane & _MASK for lane in lanes]


def _merge(lanes: list[int], secret: int, start: int) -> int:
    keys = _words(_SECRET, secret, 8)
    folded = (_fold(lanes[i] ^ keys[i], lanes[i + 1] ^ keys[i + 1]) for i in range(0, 8, 2))
    return _avalanche((start + sum(folded)) & _MASK)


def _hash_long(data: bytes) -> int:
    length = len(data)
    lanes = [_PRIME32[2], *_PRIME64[:4], _PRIME32[1], _PRIME64[4], _PRIME32[0]]
    for offset in range(0, (length - 1) // _STRIPE * _STRIPE, _STRIPE):
        _accumulate(lanes, data, offset, offset % _BLOCK // 8)
        if offset % _BLOCK == _BLOCK - _STRIPE:
            keys = _words(_SECRET, _LAST_SECRET, 8)
            lanes = [(lane ^ lane >> 47 ^ key) * _PRIME32[0] & _MASK for lane, key in zip(lanes, keys, strict=True)]
    _accumulate(lanes, data, length - _STRIPE, _LAST_SECRET - 7)
    low = _merge(lanes, 11, length * _PRIME64[0] & _MASK)
    high = _merge(lanes, _LAST_SECRET - 11, ~(length * _PRIME64[1]) & _MASK)
    return high << 64 | low
