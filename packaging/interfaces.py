"""Write the messages of ROS 2 Jazzy, as rosbags has them, into ``rclzenoh/interfaces/jazzy.json``.

rosbags has them in a module that makes a class of each, and imports those of all earlier distributions. Nobody here
needs the classes, and every node would take a tenth of its start to make them.
"""

from __future__ import annotations

import json
from pathlib import Path

from rosbags.typesys import Stores, get_typestore

PATH = Path(__file__).resolve().parents[1] / "src" / "rclzenoh" / "interfaces" / "jazzy.json"


def jazzy() -> str:
    """Constants and fields of all messages: ``{name: [constants, fields]}``, in a line each."""
    messages = get_typestore(Stores.ROS2_JAZZY).fielddefs
    lines = (f"{json.dumps(name)}: {json.dumps(messages[name], separators=(',', ':'))}" for name in sorted(messages))
    return "{\n" + ",\n".join(lines) + "\n}\n"


if __name__ == "__main__":
    PATH.write_text(jazzy(), encoding="utf-8")
