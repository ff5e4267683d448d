"""Collections in containers, driven as the launcher drives them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from uuid import uuid4

from docker.client import DockerClient
from docker.errors import APIError
from docker.models.containers import Container

from tests.e2e.collection import FAST, write_config
from throwcollect.collect.coordinator.prepare import prepare
from throwcollect.collect.runtimes.docker.containers import remove
from throwcollect.collect.runtimes.docker.docker_nodes import DockerNodes
from throwcollect.collect.runtimes.node_collection import roster
from throwcollect.collect.runtimes.nodes import NodeExit
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.collect.runtimes.supervisor import Supervisor
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.dataset.inspect import info
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey

TRIALS = 20


def config_file(directory: Path) -> Path:
    """A configuration so slow that its collection outlives the interventions of a test, with few trials to compute."""
    return write_config(directory, trials=TRIALS, sim=f"{FAST}, real_time_factor: 8")


def config_for(directory: Path, *overrides: str) -> Config:
    return load(config_file(directory), overrides)


@dataclass
class Collection:
    """A collection in containers.

    Attributes:
        runtime: Where its nodes live.
        supervisor: Keeps them alive.
        directory: Directory of the dataset; prepared.
        news: What happened to nodes other than the coordinator.
        end: How the coordinator ended.
    """

    runtime: DockerNodes
    supervisor: Supervisor
    directory: Path
    news: list[str] = field(default_factory=list)
    end: NodeExit | None = None

    def until(self, condition: Callable[[], bool]) -> None:
        """Look after the nodes until something has happened."""
        deadline = time.monotonic() + 120
        while not condition():
            assert time.monotonic() < deadline, (self.news, self.supervisor.states())
            assert self.end is None, (self.end, self.news)
            self.end, news = self.supervisor.poll()
            self.news += news
            time.sleep(0.02)

    def until_more_is_written(self) -> None:
        before = self.count_bytes()
        self.until(lambda: self.count_bytes() > before)

    def finish(self) -> str:
        """Wait for the coordinator's end; the digest of the dataset."""
        self.until(lambda: self.end is not None)
        assert self.end is not None
        assert self.end.code == 0, self.end
        return info(self.directory).digest

    def count_bytes(self) -> int:
        return sum(path.stat().st_size for path in self.directory.glob("*.mcap*"))

    def status(self, node: str) -> str:
        return next(each.status for each in self.supervisor.states() if each.name == node)


def pause(container: Container) -> None:
    """Pause a container; on a busy machine, the kernel may need several tries to freeze it."""
    for tries_left in reversed(range(10)):
        try:
            container.pause()
        except APIError as error:
            if not tries_left or "unable to freeze" not in str(error):
                raise
            time.sleep(0.2)
        else:
            return


def new_run() -> str:
    return f"test-{uuid4().hex[:8]}"


def key_in(directory: Path) -> RunKey:
    """A key of the test's own; the one that is there, if one is."""
    key = RunKey(directory / "key")
    if not key.exists:
        key.create()
    return key


def place_of(run: str, dataset: Path, key: RunKey) -> RunRecord:
    """A run whose logs lie beside the dataset."""
    return RunRecord(run, dataset, dataset / "logs", 2, Middleware(), key)


@contextmanager
def collecting(client: DockerClient, directory: Path, *overrides: str, run: str | None = None) -> Iterator[Collection]:
    """Start the nodes of a collection; nothing of it is left afterwards."""
    run = run or new_run()
    config = config_for(directory, *overrides)
    dataset = directory / "dataset"
    if not dataset.exists():
        prepare(config, dataset, sweep_directory=directory)
    runtime = DockerNodes(place_of(run, dataset, key_in(directory)), config, client=client)
    try:
        with Supervisor(runtime, config.run, roster(runtime, config.run.simulations)) as supervisor:
            runtime.open()
            supervisor.start()
            yield Collection(runtime, supervisor, dataset)
    finally:
        remove(client, run)
