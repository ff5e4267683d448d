"""Write the stubs by which type checkers know the fields of messages, services and actions, from their definitions.

``python packaging/interface_stubs.py`` writes them beside the modules that they describe.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rclzenoh.interfaces.catalog import Field, Structure, structure
from rclzenoh.interfaces.typed_names import ACTIONS, MESSAGES, SERVICES

FOLDER = Path(__file__).resolve().parents[1] / "src" / "rclzenoh" / "interfaces"
HEADER = "# Written by packaging/interface_stubs.py.\n"
_INTEGERS = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)} | {"byte"}
_SCALARS = {"bool": "bool", "string": "str", "float32": "float", "float64": "float", **dict.fromkeys(_INTEGERS, "int")}
_ARRAYS = {"bool": "Bools", "float32": "SingleFloats", "float64": "Floats", **dict.fromkeys(_INTEGERS, "Integers")}
_ARRAYS |= {"uint8": "Octets", "byte": "Octets"}


def stubs() -> Mapping[Path, str]:
    """Texts of all stubs by their paths."""
    texts = {
        "msg": _MESSAGES_BEGIN + "\n".join(_class(name, structure(full)) for name, full in sorted(MESSAGES.items())),
        "srv": _parts("Service", SERVICES, ("Request", "Response")),
        "action": _parts("Action", ACTIONS, ("Goal", "Result", "Feedback")),
    }
    return {FOLDER / f"{name}.pyi": HEADER + text for name, text in texts.items()}


_MESSAGES_BEGIN = """from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from rclzenoh.interfaces.message import Message

# What is read is an array of NumPy here, and one of Python's on genuine rclpy.
Bools = Sequence[bool] | NDArray[np.bool_]
Floats = Sequence[float] | NDArray[np.float64]
SingleFloats = Sequence[float] | NDArray[np.float32]
Integers = Sequence[int] | NDArray[np.integer[Any]]
Octets = bytes | bytearray | Sequence[int] | NDArray[np.uint8]

"""
_PARTS_BEGIN = """from dataclasses import dataclass
from typing import ClassVar

from rclzenoh.interfaces import msg
from rclzenoh.interfaces.lookup import {base}
from rclzenoh.interfaces.message import Message

"""


def _parts(base: str, names: Mapping[str, str], parts: tuple[str, ...]) -> str:
    """Stub of services or actions, whose parts are classes within them."""
    text = _PARTS_BEGIN.format(base=base)
    for name, full in sorted(names.items()):
        text += f"class {name}({base}):\n"
        text += "".join(_class(part, structure(f"{full}_{part}"), "msg.", "    ") for part in parts) + "\n"
    return text


def _class(name: str, definition: Structure, module: str = "", indent: str = "") -> str:
    lines = ["@dataclass(kw_only=True, eq=False)", f"class {name}(Message):"]
    lines += [f"    {constant}: ClassVar[{type(value).__name__}]" for constant, value in definition.constants.items()]
    lines += [f"    {field.name}: {_annotation(field, module)} = ..." for field in definition.fields]
    if len(lines) == 2:
        lines[1] += " ..."
    return "".join(f"{indent}{line}\n" for line in lines)


def _annotation(field: Field, module: str) -> str:
    """Type of a field.

    Raises:
        ValueError: If it is a message that is not among the typed ones.
    """
    is_many = field.sequence or field.length is not None
    if not field.nested:
        if is_many and field.type in _ARRAYS:
            return module + _ARRAYS[field.type]
        return f"list[{_SCALARS[field.type]}]" if is_many else _SCALARS[field.type]
    short = field.type.rpartition("/")[2]
    if MESSAGES.get(short) != field.type:
        raise ValueError(f"{field.type} is part of a typed interface and has to be one itself")
    return f"list[{module}{short}]" if is_many else module + short


if __name__ == "__main__":
    for path, text in stubs().items():
        path.write_text(text, encoding="utf-8")
