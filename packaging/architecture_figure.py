"""Draw the rooms of the product and the imports between them, as `docs/architecture.md` shows them.

``python packaging/architecture_figure.py`` writes ``docs/architecture.svg``. Rooms, arrows and libraries are read from
the sources; where a room stands, and the words in it, are in the table here.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path

import svg

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src"
FIGURE = ROOT / "docs" / "architecture.svg"

PLACES: dict[str, tuple[float, int, str]] = {
    "cli": (2.6, 0, "commands, exit codes"),
    "cluster": (0.3, 1, "Slurm: many machines"),
    "serve": (1.5, 1, "page, REST, rosbridge"),
    "runs": (0.3, 2, "prepare, follow, stop"),
    "gym": (2.7, 1, "environments to learn in"),
    "simulator": (1.5, 2, "throws for Python"),
    "runtimes": (0.3, 3, "where nodes live"),
    "replay": (0.3, 4, "throws once more"),
    "learning": (4.2, 4, "targets to parameters"),
    "sim": (-0.05, 6, "one trial"),
    "coordinator": (1.1, 5, "rules of a collection"),
    "derive": (2.2, 5, "other datasets"),
    "export": (3.2, 5, "other formats"),
    "report": (4.2, 5, "a page"),
    "view": (5.2, 5, "files for viewers"),
    "engines": (-1.55, 7, "physics"),
    "ros": (-0.55, 4, "nodes, two backends"),
    "trial": (1.1, 6, "leases, conditions"),
    "dataset": (3.2, 6, "the files"),
    "sweep": (2.9, 7, "the plan"),
    "tasks": (2.6, 8, "motion and judging"),
    "sensing": (4.9, 8, "cameras, lidars"),
    "episode": (2.2, 9, "samples ↔ bytes"),
    "robots": (2.5, 10, "what a robot is"),
    "ros_installation": (-0.55, 11, "is ROS 2 here?"),
    "tools": (2.5, 11, "what a tool is"),
    "control": (3.5, 11, "controller arithmetic"),
    "config": (1.6, 12, "the shape of a run"),
    "rclzenoh": (-0.55, 12, "ROS 2 client of its own"),
}
"""Column, row and words of each room; rooms that are not named here lie below all others, without arrows."""
DOORS = (
    "fastapi",
    "pybullet",
    "mujoco",
    "pinocchio",
    "zenoh",
    "rclpy",
    "rosbags",
    "mcap",
    "docker",
    "plotly",
    "jinja2",
)
"""Outside libraries whose rooms are shown."""

COLUMN, ROW, WIDTH, HEIGHT = 158, 82, 140, 54
LEFT, TOP = 330, 44
TOTAL_WIDTH, GROUND = 1240, TOP + 13 * ROW - 10


def read_imports() -> tuple[dict[str, set[str]], dict[str, set[str]]]:
    """Which rooms each room imports, and which outside libraries."""
    inside = SOURCE / "throwcollect"
    rooms = {path.stem for path in inside.iterdir() if not path.name.startswith("__") and path.suffix in ("", ".py")}
    imported: dict[str, set[str]] = {room: set() for room in (*rooms, "rclzenoh")}
    outside: dict[str, set[str]] = {room: set() for room in imported}
    for path in SOURCE.rglob("*.py"):
        package, *parts = path.relative_to(SOURCE).with_suffix("").parts
        room = package if package == "rclzenoh" else parts[0]
        if room not in imported:
            continue  # The face of the package, which belongs to no room.
        for name in _list_imported_names(ast.parse(path.read_text(encoding="utf-8"))):
            first, *rest = name.split(".")
            imported[room] |= {first if first == "rclzenoh" else rest[0]} & imported.keys() if _is_ours(name) else set()
            outside[room] |= {first} & set(DOORS)
        imported[room].discard(room)
    return imported, outside


def _is_ours(name: str) -> bool:
    return name.split(".")[0] == "rclzenoh" or name.startswith("throwcollect.")


def _list_imported_names(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "lazily":
            yield ast.literal_eval(node.args[0])


def reduce_arrows(imported: Mapping[str, set[str]]) -> list[tuple[str, str]]:
    """Imports between rooms that have a place, without those that others imply.

    Raises:
        ValueError: If a room below all others imports one that has a place.
    """
    for room in imported.keys() - PLACES.keys():
        # The client imports nothing of ours, so it lies as low as they do.
        if above := imported[room] & PLACES.keys() - {"rclzenoh"}:
            raise ValueError(f"{room} imports {', '.join(sorted(above))}; give it a place in PLACES")
    graph = {room: imported[room] & PLACES.keys() for room in PLACES}
    below = {room: _descend(room, graph) for room in graph}
    return [
        (room, other)
        for room, others in graph.items()
        for other in sorted(others)
        if not any(other in below[between] for between in others - {other})
    ]


def _descend(room: str, graph: Mapping[str, set[str]]) -> set[str]:
    return {each for other in graph[room] for each in (other, *_descend(other, graph))}


def draw() -> str:
    """Draw the figure as SVG."""
    imported, outside = read_imports()
    parts = []
    for room, other in reduce_arrows(imported):
        (x, y), (to_x, to_y) = _centre(room), _centre(other)
        parts.append(svg.line(x, y + HEIGHT / 2, to_x, to_y - HEIGHT / 2))
    for room, (_, _, words) in PLACES.items():
        parts += _box(*_centre(room), room, words, ", ".join(sorted(outside[room])))
    ground = sorted(imported.keys() - PLACES.keys())
    middle = TOTAL_WIDTH / 2
    parts += [
        svg.rectangle(middle, GROUND + 37, TOTAL_WIDTH - 40, 74, "ground"),
        svg.text(middle, GROUND + 22, "below all of them, for any to import", "words"),
        *(
            svg.text(middle, y, " · ".join(part), "title")
            for y, part in ((GROUND + 42, ground[: len(ground) // 2]), (GROUND + 60, ground[len(ground) // 2 :]))
        ),
        _note(0, "An arrow is an import. Those that follow from others are left out:"),
        _note(1, "runs import runtimes, which import replay; so runs may import replay, too."),
        _note(2, "In colour: libraries that come in by this room."),
    ]
    return svg.figure(TOTAL_WIDTH, GROUND + 110, parts, script="architecture_figure.py")


def _centre(room: str) -> tuple[float, float]:
    column, row, _ = PLACES[room]
    return round(LEFT + column * COLUMN, 1), TOP + row * ROW


def _box(x: float, y: float, room: str, words: str, libraries: str) -> list[str]:
    return [
        svg.rectangle(x, y, WIDTH, HEIGHT, "box"),
        svg.text(x, y - 9, room, "title"),
        svg.text(x, y + 6, words, "words"),
        svg.text(x, y + 20, libraries, "library"),
    ]


def _note(row: int, words: str) -> str:
    return svg.text(TOTAL_WIDTH - 20, TOP + 9 * ROW + 18 * row, words, "words", anchor="end")


if __name__ == "__main__":
    FIGURE.write_text(draw(), encoding="utf-8")
