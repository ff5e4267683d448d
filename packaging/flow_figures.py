"""Draws who hands what to whom, for `docs/architecture.md`.

``python packaging/flow_figures.py`` writes ``docs/figures``. Boxes stand in columns and rows; a box is what does
something, unless it is a file.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import svg

FIGURES = Path(__file__).resolve().parents[1] / "docs" / "figures"
COLUMN, ROW, WIDTH, HEIGHT, MARGIN = 176, 92, 144, 54, 14
"""Distances of boxes, their size, and the rim of a figure."""


@dataclass(frozen=True)
class Box:
    """A box.

    Attributes:
        column: Where it stands, from 0.
        row: As `column`.
        title: Its name.
        words: What it is, at most two lines.
        file: Whether it is something on disk.
    """

    column: float
    row: float
    title: str
    words: str = ""
    file: bool = False


@dataclass(frozen=True)
class Flow:
    """A figure.

    Attributes:
        boxes: By names that arrows use.
        arrows: A line each: two names with `>` or `<>` between them, and perhaps a colon and what is handed over.
    """

    boxes: dict[str, Box]
    arrows: str


FLOWS = {
    "overview": Flow(
        {
            "yaml": Box(0, 0, "YAML file", "what varies", file=True),
            "config": Box(1, 0, "config", "all keys, checked"),
            "sweep": Box(2, 0, "sweep", "draws and checks trials"),
            "plan": Box(3, 0, "plan.parquet", "all trials", file=True),
            "runtime": Box(4.3, 0, "runtime", "starts all nodes, as\nprocesses or containers"),
            "router": Box(1, 1, "router", "nodes find each other"),
            "coordinator": Box(3, 1, "coordinator", "leases trials"),
            "sim": Box(4.3, 1, "simulations", "physics and joint\ntrajectory controllers"),
            "dataset": Box(3, 2, "dataset", "recordings and tables", file=True),
            "use": Box(1.5, 2, "what is made of it", "reports, exports, other\ndatasets, models, replays"),
        },
        """yaml > config
        config > sweep
        sweep > plan
        plan > runtime
        plan > coordinator
        runtime > sim
        coordinator > router: joins, as all nodes
        coordinator <> sim: ROS 2
        coordinator > dataset: episodes
        dataset > use""",
    ),
    "run": Flow(
        {
            "prepare": Box(0, 0, "preparation", "plan, checks"),
            "lock": Box(1, 0, "record and lock", "of the run", file=True),
            "launcher": Box(2, 0, "launcher", "up, or its own process"),
            "host": Box(3, 0, "Host", "has trials simulated"),
            "local": Box(4, -0.7, "LocalNodes", "processes, a supervisor"),
            "docker": Box(4, 0, "DockerNodes", "containers, a supervisor"),
            "here": Box(4, 0.7, "InProcess", "one simulation, no nodes"),
            "scale": Box(0, 1.1, "scale"),
            "stop": Box(1, 1.3, "stop, down"),
            "events": Box(2, 1.35, "record, events.jsonl", "what has come of it", file=True),
            "progress": Box(3, 1.1, "coordinator", "anybody may listen"),
            "look": Box(0.8, 2.1, "ps, logs, events, wait", "read files, ask nobody"),
        },
        """prepare > lock
        lock > launcher
        launcher > host
        host > local
        host > docker
        host > here
        scale > launcher: ROS parameter
        stop > launcher: SIGTERM
        launcher > events
        progress > launcher: progress
        events > look""",
    ),
    "serve": Flow(
        {
            "browser": Box(0, 0, "browser", "the page"),
            "roslib": Box(0, 1, "roslib, roslibpy", "rosbridge"),
            "programs": Box(0, 2, "programs", "REST"),
            "serve": Box(1.6, 1, "serve", "one process, no state"),
            "records": Box(3.4, 0, "records, events, logs", "of all runs", file=True),
            "runs": Box(3.4, 1, "runs", "each a process of its own"),
            "node": Box(3.4, 2, "a node in each graph", "that is watched"),
        },
        """browser > serve
        roslib <> serve: one port
        programs > serve
        records > serve: read after each change
        serve > runs: begin, stop, scale
        node <> serve: messages, newest throw""",
    ),
    "slices": Flow(
        {
            "plan": Box(0, 0, "plan", "all trials", file=True),
            "slices": Box(1, 0, "slices", "whole shards"),
            "attempt": Box(2, 0, "attempts", "a directory each"),
            "done": Box(3.25, 0, "slices/3-of-8", "whole, or not there", file=True),
            "join": Box(4.25, 0, "join", "the files of\none collection"),
            "submit": Box(1, 1, "submit", "an array for Slurm"),
        },
        """plan > slices
        slices > attempt
        attempt > done: rename
        done > join
        slices > submit
        submit > attempt: up --slice 3/8""",
    ),
    "simulation": Flow(
        {
            "ros": Box(0, 0.5, "ROS 2", "topics, services, actions"),
            "node": Box(1.1, 0, "node", "leases in, episodes out"),
            "controllers": Box(1.1, 1, "controller_node × 8", "and controller_manager"),
            "services": Box(1.1, 2, "services", "simulation_interfaces:\ncontrol, entities, stepping"),
            "simulation": Box(2.4, 0.5, "simulation", "steps all of it"),
            "limb": Box(2.4, 1.6, "limb × 8", "controller and its joints"),
            "world": Box(3.5, 0.5, "world", "rules of a trial"),
            "control": Box(3.5, 1.6, "control", "arithmetic"),
            "engine": Box(4.5, 0.5, "engine", "physics"),
        },
        """ros <> node
        ros <> controllers
        ros <> services
        node > simulation
        controllers > simulation
        services > simulation
        simulation > limb
        simulation > world
        limb > control
        world > engine""",
    ),
    "trust": Flow(
        {
            "key": Box(0, 0, "key of the run", "its owner's alone", file=True),
            "router": Box(1.5, 0, "router", "mutual TLS"),
            "nodes": Box(3.3, 0, "whoever joins", "nodes, launcher,\nthrowcollect ros --run"),
            "coordinator": Box(0, 1, "coordinator", "signs leases,\nchecks episodes"),
            "simulation": Box(2.4, 1, "simulation", "signs episodes"),
            "dataset": Box(0, 2, "dataset", file=True),
            "again": Box(1.3, 2, "a few trials again", "in a fresh process"),
            "package": Box(2.5, 2, "datapackage.json", "all hashes", file=True),
            "metadata": Box(3.55, 2, "metadata.yaml", "written last", file=True),
            "code": Box(4.6, 2, "exit code 0"),
        },
        """key > router
        nodes > router: let in by the key
        coordinator <> simulation: signed leases, signed episodes
        coordinator > dataset
        dataset > again
        again > package
        package > metadata
        metadata > code""",
    ),
    "middleware": Flow(
        {
            "key": Box(0, 0, "run.ros", "a key"),
            "choice": Box(1, 0, "Middleware", "backend and RMW"),
            "record": Box(2, 0, "record", "of the run", file=True),
            "connection": Box(3, 0, "Connection", "the way in"),
            "environment": Box(4.1, -0.4, "every node", "by its environment"),
            "context": Box(4.1, 0.4, "whoever joins", "by its context"),
            "zenoh": Box(1.9, 1.1, "router of Zenoh", "embedded client,\nrmw_zenoh_cpp"),
            "dds": Box(3.2, 1.1, "discovery server", "of Fast DDS:\nrmw_fastrtps_cpp"),
        },
        """key > choice
        choice > record
        record > connection
        connection > environment
        connection > context
        connection > zenoh: either
        connection > dds: or""",
    ),
    "recovery": Flow(
        {
            "episode": Box(0, 0, "episode", "arrives whole, or not"),
            "part": Box(1.2, 0, ".mcap.part", "in order of arrival", file=True),
            "shard": Box(2.4, 0, ".mcap", "in order of trials,\nrenamed when whole", file=True),
            "tables": Box(3.6, 0, "tables", "then metadata.yaml,\nlast of all", file=True),
            "recovery": Box(1.8, 1.1, "recovery", "whole episodes stay,\nthe rest is run again"),
        },
        """episode > part
        part > shard
        shard > tables
        part > recovery
        shard > recovery""",
    ),
}


def draw(flow: Flow) -> str:
    """Draw a figure as SVG."""
    boxes = flow.boxes.values()
    top, bottom = min(box.row for box in boxes), max(box.row for box in boxes)
    width = max(box.column for box in boxes) * COLUMN + WIDTH + 2 * MARGIN
    arrows, labels = [], []
    for arrow in flow.arrows.splitlines():
        names, _, words = arrow.partition(":")
        start, _, end = (part.strip() for part in names.replace("<", " ").partition(">"))
        x, y = _centre(flow.boxes[start], top)
        to_x, to_y = _centre(flow.boxes[end], top)
        dx, dy = to_x - x, to_y - y
        # From rim to rim: the share of the way that lies in a box is the same at both ends.
        inside = min(WIDTH / 2 / abs(dx) if dx else 1.0, HEIGHT / 2 / abs(dy) if dy else 1.0)
        ends = (x + dx * inside, y + dy * inside, to_x - dx * inside, to_y - dy * inside)
        arrows.append(svg.line(*ends, both="<" in names))
        if words:
            labels.append(svg.text(x + dx / 2, y + dy / 2 + (4 if dy else -5), words.strip(), "label"))
    drawn = [part for box in boxes for part in _draw(box, top)]
    height = (bottom - top) * ROW + HEIGHT + 2 * MARGIN
    return svg.figure(width, height, [*arrows, *drawn, *labels], script="flow_figures.py")


def _centre(box: Box, top: float) -> tuple[float, float]:
    return MARGIN + WIDTH / 2 + box.column * COLUMN, MARGIN + HEIGHT / 2 + (box.row - top) * ROW


def _draw(box: Box, top: float) -> list[str]:
    x, y = _centre(box, top)
    lines = box.words.splitlines()
    # Title and lines are 14 apart, and amid the box.
    first = y + 4.5 - 7 * len(lines)
    return [
        svg.rectangle(x, y, WIDTH, HEIGHT, "file" if box.file else "box"),
        svg.text(x, first, box.title, "title"),
        *(svg.text(x, first + 14 * (row + 1), line, "words") for row, line in enumerate(lines)),
    ]


if __name__ == "__main__":
    FIGURES.mkdir(exist_ok=True)
    for name, flow in FLOWS.items():
        (FIGURES / f"{name}.svg").write_text(draw(flow), encoding="utf-8")
