"""The list of what the embedded backend leaves out of rclpy's API, in the documentation, is complete and true."""

import inspect
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from rclzenoh import api as embedded
from rclzenoh import client, service, subscription, time, timer
from rclzenoh.action.client import ClientGoalHandle
from rclzenoh.action.server import ServerGoalHandle
from rclzenoh.logging import Logger
from rclzenoh.node_graph import TopicEndpointInfo
from throwcollect.ros import embedded as ros

API = Path(__file__).with_name("rclpy_api.txt")
PAGE = Path(__file__).parents[2] / "docs" / "ros.md"
HEADING = "### What of rclpy's API there is not"
CLASSES: dict[str, Any] = {
    **{
        name: getattr(embedded, name)
        for name in (
            *("ActionClient", "ActionServer", "CancelResponse", "Context", "DurabilityPolicy", "Executor", "Future"),
            *("GoalResponse", "HistoryPolicy", "Node", "Parameter", "Publisher", "QoSProfile", "ReliabilityPolicy"),
            *("SingleThreadedExecutor", "Time"),
        )
    },
    "Client": client.Client,
    "ClientGoalHandle": ClientGoalHandle,
    "Logger": Logger,
    "ROSClock": time.ROSClock,
    "ServerGoalHandle": ServerGoalHandle,
    "Service": service.Service,
    "Subscription": subscription.Subscription,
    "Timer": timer.Timer,
    "TopicEndpointInfo": TopicEndpointInfo,
}
"""Classes that our nodes meet, by the names that they have in rclpy."""
MODULES = {"rclpy": ros, "rclpy.action": embedded, "rclpy.executors": embedded, "rclpy.qos": embedded}


@cache
def members(kind: type) -> set[str]:
    """Names of a class and its bases, and of what its instances are given when they are made."""
    names = set(dir(kind))
    for each in kind.__mro__[:-1]:
        if each.__module__.startswith("rclzenoh"):
            names |= set(getattr(each, "__annotations__", ()))
            names |= set(re.findall(r"self\.([a-z]\w*)(?:: [^=]+)? = ", inspect.getsource(each)))
    return names


def has(name: str) -> bool:
    """Whether there is a name of rclpy's, such as ``Node.create_timer(clock)``."""
    whole, _, parameter = name.removesuffix(")").partition("(")
    above, _, last = whole.rpartition(".")
    holder = MODULES.get(above) or CLASSES.get(above) or CLASSES.get(whole)
    if holder is None:
        return False
    names = set(dir(holder)) if above in MODULES else members(holder)
    exists = whole in CLASSES or last in names
    if not parameter or not exists:
        return exists
    function = holder if whole in CLASSES else getattr(holder, last)
    found = inspect.signature(function).parameters
    return parameter in found


def missing() -> Iterator[str]:
    """Names of rclpy that the embedded backend lacks; of a missing class only the class, not its members."""
    gone: set[str] = set()
    for line in API.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            continue
        above = line.partition("(")[0].rpartition(".")[0]
        owner = line.partition("(")[0] if above in MODULES else re.split(r"[.(]", line)[0]
        if above not in MODULES and owner not in CLASSES:
            gone.add(owner)
        elif not has(line) and ("(" not in line or has(line.partition("(")[0])):
            gone.add(line)
    yield from sorted(gone)


def rows() -> list[str]:
    """The table of the documentation."""
    table: dict[str, list[str]] = {}
    for name in missing():
        whole, bracket, parameter = name.partition("(")
        above, _, last = whole.rpartition(".")
        if not above and bracket:
            above, last = whole, "__init__"
        table.setdefault(above or "classes", []).append(f"`{last}{bracket}{parameter}`")
    titles = {"classes": "classes as a whole"}
    return [f"| {titles.get(above, f'`{above}`')} | {', '.join(names)} |" for above, names in table.items()]


def test_the_documented_list_of_missing_parts_of_rclpy_is_complete() -> None:
    section = PAGE.read_text(encoding="utf-8").partition(HEADING)[2].partition("\n## ")[0]
    assert [line for line in section.splitlines() if line.startswith("| ")][1:] == rows(), "\n".join(rows())


def test_every_public_name_of_the_embedded_backend_is_used() -> None:
    root = Path(__file__).parents[2]
    # These modules name what a backend has; all others name only what they use.
    backends = [root / "src" / "throwcollect" / "ros" / f"{name}.py" for name in ("__init__", "embedded", "genuine")]
    used = "\n".join(
        path.read_text(encoding="utf-8")
        for folder in (root / "src" / "throwcollect", root / "tests", root / "bench")
        for path in folder.rglob("*.py")
        if path not in backends
    )
    assert [name for name in embedded.__all__ if not re.search(rf"\b{name}\b", used)] == []
