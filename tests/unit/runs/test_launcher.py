"""Containers that a launcher leaves on a Docker engine, and what the record of the run says about them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from tests.unit.runtimes.docker.engine import Engine, engine_at

from throwcollect.cli.runs import ps
from throwcollect.config.schema import Config
from throwcollect.coordinator.progress import Progress
from throwcollect.errors import WorkerError
from throwcollect.runs.launcher import launch
from throwcollect.runs.records import Records
from throwcollect.runs.run import Run
from throwcollect.runs.run_record import RunRecord
from throwcollect.runtimes.docker import containers, docker_nodes
from throwcollect.state_directory import STATE_VARIABLE

CONFIG = Config.model_validate({"containers": {"image": "image"}, "run": {"simulations": 1}})


class Onlooker:
    """Remembers the warnings."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def update(self, progress: Progress) -> None:
        pass

    def say(self, line: str) -> None:
        pass

    def warn(self, line: str) -> None:
        self.warnings.append(line)


@pytest.fixture
def engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Engine]:
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/engine.sock")
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    monkeypatch.setattr(containers, "_POLL_S", 0.05)
    monkeypatch.setattr(containers, "SILENCE_S", 1.0)
    monkeypatch.setattr(docker_nodes, "ANSWER_S", 0.5)
    with engine_at(tmp_path / "engine.sock") as engine:
        yield engine


@pytest.fixture
def run(engine: Engine, tmp_path: Path) -> Run:
    for name in ("logs", "data"):
        (tmp_path / name).mkdir()
    run = Records().new("throws")
    record = RunRecord.begin(run.id, "throws", tmp_path / "data", logs=tmp_path / "logs", runtime="docker")
    run.write(replace(record, simulations=1))
    return run


def launch_run(run: Run, each_look: Callable[[], None] = lambda: None, *, onlooker: Onlooker | None = None) -> None:
    def interruptions() -> int:
        each_look()
        return 0

    launch(run, interruptions, config=CONFIG, onlooker=onlooker or Onlooker())


def status(run: Run) -> str:
    return Records().get(run.id).status


def test_a_launcher_that_gives_up_says_that_containers_are_left(
    engine: Engine, run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    onlooker = Onlooker()

    def silence() -> None:
        if len(engine.running()) == 3:
            engine.withheld = "."

    with pytest.raises(WorkerError, match=r"the Docker engine has not answered for [12] s"):
        launch_run(run, silence, onlooker=onlooker)
    assert onlooker.warnings == [
        f"containers of this run may be left: throwcollect down --run {run.id} ends them",
    ]
    engine.answer_all()
    assert status(run) == "abandoned"
    ps(everything=False, json=False)
    told = capsys.readouterr().out
    assert re.search(rf"{run.id} +docker .* abandoned \d+ s ago, exit code 3", told)
    assert re.search(r"  sim_0 +starting +container ", told)
