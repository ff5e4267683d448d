"""Shared libraries as the loader sees them: which others they need, and which bytes of the file it maps.

64-bit little-endian ELF files alone, as on x86-64 and AArch64.
"""

from __future__ import annotations

import struct

_MAGIC = b"\x7fELF\x02\x01"
_PROGRAM_HEADERS = struct.Struct("<Q")
_PROGRAM_HEADER_COUNTS = struct.Struct("<HH")
_PROGRAM_HEADER = struct.Struct("<IIQQQQQQ")
_SECTION_OFFSET_AT, _SECTION_COUNTS_AT = 40, 60
_DYNAMIC_ENTRY = struct.Struct("<QQ")
_LOAD, _DYNAMIC = 1, 2
_NEEDED, _STRING_TABLE = 1, 5


def is_elf(content: bytes) -> bool:
    """Whether these are the bytes of a file that this module understands."""
    return content.startswith(_MAGIC)


def list_needed(content: bytes) -> list[str]:
    """File names of the libraries that the loader looks for when it loads this one.

    Args:
        content: The whole file.
    """
    segments = _segments(content)
    dynamic = next((segment for segment in segments if segment[0] == _DYNAMIC), None)
    if dynamic is None:
        return []
    _, _, offset, _, _, size, _, _ = dynamic
    entries = list(_DYNAMIC_ENTRY.iter_unpack(content[offset : offset + size - size % _DYNAMIC_ENTRY.size]))
    names = _file_offset(segments, next(value for tag, value in entries if tag == _STRING_TABLE))
    starts = [names + value for tag, value in entries if tag == _NEEDED]
    return [content[start : content.index(b"\0", start)].decode() for start in starts]


def strip(content: bytes) -> bytes:
    """The file without what is behind its last segment: symbols for linkers and debuggers, and the section headers.

    Unlike `strip`, it moves nothing, so that libraries that were patched after linking stay intact.

    Args:
        content: The whole file.
    """
    end = max(offset + size for _, _, offset, _, _, size, _, _ in _segments(content))
    shortened = bytearray(content[:end])
    struct.pack_into("<Q", shortened, _SECTION_OFFSET_AT, 0)
    struct.pack_into("<HH", shortened, _SECTION_COUNTS_AT, 0, 0)
    return bytes(shortened)


def _segments(content: bytes) -> list[tuple[int, ...]]:
    (start,) = _PROGRAM_HEADERS.unpack_from(content, 32)
    size, count = _PROGRAM_HEADER_COUNTS.unpack_from(content, 54)
    return [_PROGRAM_HEADER.unpack_from(content, start + size * index) for index in range(count)]


def _file_offset(segments: list[tuple[int, ...]], address: int) -> int:
    return next(
        offset + address - start
        for kind, _, offset, start, _, size, _, _ in segments
        if kind == _LOAD and start <= address < start + size
    )
