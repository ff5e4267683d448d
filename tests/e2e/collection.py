"""Runs whole collections as a user does: the command in a process of its own."""

from __future__ import annotations

import hashlib
import io
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import pytest

from tests.commands import Command, command, start_command
from tests.restrictions import FREE, Restrictions
from throwcollect.cli.main import main
from throwcollect.own_process import stop_signals

CONFIG = """\
name: small
trials: {trials}
seed: 7
sweep:
  sampler: uniform
  parameters:
    task.end.arm_right_4_joint: {{min: -0.7, max: -0.4}}
    task.duration_s: {{min: 1.0, max: 1.2}}
    ball.mass_kg: {{min: 0.03, max: 0.06}}
run: {{runtime: local, replay: 0}}
"""
"""The uniform sampler needs no library that would take each command a second to import."""


SENSORS = """\
sensors:
  eye:
    kind: camera
    width: 24
    height: 16
    rate_hz: 2
    streams: [color, depth, segmentation]
    noise: {{color_std: 2, recorded: true}}
  near: {{kind: depth, link: {link}, position_m: [0.1, 0, 0], width: 16, height: 12, rate_hz: 1}}
  scan: {{kind: lidar_2d, link: base_link, position_m: [0.4, 0, 0.3], rays: 36, rate_hz: 1}}
  cloud: {{kind: lidar_3d, position_m: [1, -1, 1], layers: 4, rays: 36, rate_hz: 1}}
"""
"""Sensors of each kind, with few frames, the depth camera on a link of the robot that moves."""
SEEING = """\
name: small
trials: {trials}
seed: 7
robot: {{name: xarm7}}
task:
  duration_s: 0.72
  start:
    {{joint1: -0.989, joint2: -1.962, joint3: 2.71, joint4: 2.733, joint5: 0.592, joint6: -0.826, joint7: 0.179}}
  end: {{joint1: -0.0091, joint4: 3.645, joint5: -0.4363}}
sweep: {{sampler: uniform, parameters: {{task.duration_s: {{min: 0.72, max: 0.828}}}}}}
run: {{runtime: local, replay: 0}}
""" + SENSORS.replace("{link}", "link7").replace("base_link", "link_base")
"""An arm with sensors; a simulation reads its meshes in a fifth of the time of those of Talos."""


def call(
    *arguments: str | Path, cwd: Path | None = None, restrictions: Restrictions = FREE, **environment: str
) -> subprocess.CompletedProcess[str]:
    process = start_command(*arguments, cwd=cwd, restrictions=restrictions, **environment)
    out, err = process.communicate(timeout=120)
    return subprocess.CompletedProcess(command(*arguments), process.wait(), out, err)


def call_here(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """The same command in this process, for what does not depend on a process: starting one takes a second."""
    out, err = io.StringIO(), io.StringIO()
    before = [(number, signal.getsignal(number)) for number in stop_signals()]
    wanted = ["throwcollect", *map(str, arguments)]
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", wanted)
        try:
            with pytest.raises(SystemExit) as end:
                main()
        finally:
            for number, handler in before:
                signal.signal(number, handler)
    code = end.value.code
    assert isinstance(code, int)
    return subprocess.CompletedProcess(wanted, code, out.getvalue(), err.getvalue())


FAST = "engine: ballistic"
"""For tests of nodes and files: throws without contacts take a sixth of the time, and give the same kinds of files."""


INPROCESS = ("--runtime", "inprocess")
"""For tests that only need the dataset: no node has to be started."""


def words_of(process: psutil.Process) -> list[str]:
    """Words of a command line, as `ps` shows it: psutil returns that of a forked node as one padded text."""
    return " ".join(process.cmdline()).split()


def write_config(directory: Path, *, trials: int, text: str = CONFIG, sim: str = "") -> Path:
    path = directory / "small.yaml"
    path.write_text(text.format(trials=trials) + (f"sim: {{{sim}}}\n" if sim else ""))
    return path


@dataclass
class Running:
    """A running `throwcollect up`."""

    process: Command
    directory: Path

    def nodes(self) -> list[psutil.Process]:
        """Nodes of the run; a new one has the command line of the process from which it is forked for a moment."""
        children = psutil.Process(self.process.pid).children(recursive=True)
        return [child for child in children if not {"router", "sim", "coordinator"}.isdisjoint(words_of(child))]

    def node(self, *words: str) -> psutil.Process:
        """The node whose command line ends with these words."""
        for node in self.nodes():
            if words_of(node)[-len(words) :] == list(words):
                return node
        raise LookupError(words)

    def count_bytes(self) -> int:
        """Number of bytes of the shards so far."""
        return sum(path.stat().st_size for path in self.directory.glob("*.mcap*"))

    def wait_until(self, condition: Callable[[], bool], *, seconds: float = 60) -> None:
        deadline = time.monotonic() + seconds
        while not condition():
            if self.process.poll() is not None or time.monotonic() > deadline:
                self.process.kill()
                raise AssertionError(f"did not happen; the command says: {self.process.communicate()}")
            time.sleep(0.03)

    def finish(self) -> tuple[int, str, str]:
        out, err = self.process.communicate(timeout=120)
        return self.process.returncode, out, err


def start(config: Path, directory: Path, simulations: int, *options: str, **environment: str) -> Running:
    wanted = ("up", "-n", str(simulations), "--runtime", "local", config, "--output", directory, *options)
    return launch(directory, *wanted, **environment)


def launch(directory: Path, *arguments: str | Path, **environment: str) -> Running:
    """A running command that collects into a directory."""
    return Running(start_command(*arguments, **environment), directory)


def collect(config: Path, directory: Path, simulations: int, *options: str, **environment: str) -> dict[str, object]:
    """A whole collection; returns its summary."""
    code, out, err = start(config, directory, simulations, "--json", *options, **environment).finish()
    assert code == 0, err
    summary: dict[str, object] = json.loads(out)
    return summary


def collect_here(config: Path, directory: Path, *options: str) -> dict[str, object]:
    """A whole collection in this process; returns its summary.

    It writes the files that nodes write (`test_purity.py`), so it makes the dataset wherever nodes are not the point.
    """
    done = call_here("up", *INPROCESS, config, "--output", directory, "--json", *options)
    assert done.returncode == 0, done.stderr
    summary: dict[str, object] = json.loads(done.stdout)
    return summary


def journal(directory: Path) -> list[dict[str, Any]]:
    """Whole lines of the journal of a dataset."""
    path = directory / "logs" / "journal.jsonl"
    lines = path.read_bytes().split(b"\n")[:-1] if path.exists() else []
    return [json.loads(line) for line in lines if line.endswith(b"}")]


def fingerprints(directory: Path) -> dict[str, str]:
    """SHA-256 of every file that must be the same for the same YAML file."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(directory.iterdir())
        if path.is_file() and path.name not in ("README.md", "datapackage.json", "provenance.json")
    }


def interrupt(running: Running) -> None:
    running.process.send_signal(signal.SIGINT)
