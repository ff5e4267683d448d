"""A collection in steady state, in processes or containers: throws a second, and where time and memory go."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import psutil
from docker.client import DockerClient

from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.runtimes.docker.docker_nodes import DockerNodes
from throwcollect.collect.runtimes.local import LocalNodes
from throwcollect.collect.runtimes.node_collection import roster
from throwcollect.collect.runtimes.nodes import NodeHost
from throwcollect.collect.runtimes.run_listener import RunListener
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.collect.runtimes.supervisor import Supervisor
from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.dataset.creation import create
from throwcollect.plan.plan import Plan, make_trials
from throwcollect.plan.samplers import draw_points
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey

ROLES = ("sim", "router", "coordinator")
_POLL_S = 0.1
"""Longest wait for news, which is that of the launcher: whoever looks more often takes time from the simulations."""


@dataclass(frozen=True)
class Collection:
    """What one collection cost.

    Attributes:
        throws_per_s: In steady state: between a tenth and nine tenths of the trials.
        cpu_ms_per_throw: Processor time of each role in that span, for one throw [ms].
        disk_ms_per_throw: What of the coordinator's was spent in the kernel, for files and network [ms].
        memory_mb: Largest resident memory of a process of each role [MB].
        bytes_per_throw: Size of the recordings on disk, for one throw.
        first_throw_s: From the start of the nodes to the end of the first throws [s].
    """

    throws_per_s: float
    cpu_ms_per_throw: dict[str, float]
    disk_ms_per_throw: float
    memory_mb: dict[str, float]
    bytes_per_throw: float
    first_throw_s: float


@dataclass(frozen=True)
class _Mark:
    time_s: float
    ended: int
    cpu_s: dict[str, float]
    kernel_s: dict[str, float]


def draw_unchecked_plan(config: Config) -> Plan:
    """Draw the trials of a sweep, none of which is refused.

    None is simulated again at the end, either: that takes a second of processor time a run, and nothing a throw.
    """
    config = with_values(config, {"run.replay": 0})
    return Plan(config, make_trials(config, draw_points(config, directory=Path())))


def _until(supervisor: Supervisor, listener: RunListener, reports: list[Progress], ended: int) -> float:
    """Wait until so many trials have ended; the time."""
    while not reports or reports[-1].ended < ended:
        listener.spin(supervisor.host.connection, _POLL_S)
        if (end := supervisor.poll()[0]) is not None:
            raise RuntimeError(f"the collection ended early: {end.reason}: {end.log}")
    return time.monotonic()


class _Watch:
    """Follows one collection from the outside."""

    def __init__(self, supervisor: Supervisor, listener: RunListener, reports: list[Progress]) -> None:
        self._supervisor = supervisor
        self._listener = listener
        self._reports = reports
        names = supervisor.host.running()
        self._nodes = {name: _process(supervisor.host.handle(name) or "") for name in names}

    def until(self, ended: int) -> _Mark:
        return _Mark(
            _until(self._supervisor, self._listener, self._reports, ended),
            self._reports[-1].ended,
            self._sum(lambda node: sum(node.cpu_times()[:2])),
            self._sum(lambda node: node.cpu_times().system),
        )

    def memory_mb(self) -> dict[str, float]:
        return {
            role: max(node.memory_info().rss / 1e6 for name, node in self._nodes.items() if name.startswith(role))
            for role in ROLES
        }

    def finish(self) -> None:
        while self._supervisor.poll()[0] is None:
            self._listener.spin(self._supervisor.host.connection, _POLL_S)

    def _sum(self, measure: Callable[[psutil.Process], float]) -> dict[str, float]:
        return {
            role: sum(measure(node) for name, node in self._nodes.items() if name.startswith(role)) for role in ROLES
        }


def _process(handle: str) -> psutil.Process:
    """The process of a node, by the id of its process or container."""
    if handle.isdigit():
        return psutil.Process(int(handle))
    init = DockerClient.from_env().containers.get(handle).attrs["State"]["Pid"]
    (node,) = psutil.Process(init).children()
    return node


def _key(directory: Path) -> RunKey:
    """Key of the run that collects into a directory."""
    key = RunKey(directory.with_name(f"{directory.name}-key"))
    if not key.exists:
        key.create()
    return key


def _place(name: str, directory: Path) -> RunRecord:
    return RunRecord(name, directory, directory / "logs", 0, Middleware.of_process(), _key(directory))


def local_runtime(plan: Plan, directory: Path) -> NodeHost:
    """Nodes as processes."""
    return LocalNodes(_place("bench", directory), plan.config)


def docker_runtime(plan: Plan, directory: Path) -> NodeHost:
    """Nodes as containers of the default image."""
    host = DockerNodes(_place(f"bench-{os.getpid()}", directory), plan.config)
    host.open()
    return host


def measure(
    plan: Plan, simulations: int, directory: Path, make_runtime: Callable[[Plan, Path], NodeHost] = local_runtime
) -> Collection:
    """Collect all trials of a plan, as the command does, and watch the processes.

    Args:
        plan: The trials.
        simulations: Number of simulations.
        directory: Where the dataset is left.
        make_runtime: Makes the place where the nodes live; the time it takes counts.
    """
    trials = sum(trial.refused is None for trial in plan.trials)
    create(directory, plan)
    reports: list[Progress] = []
    began = time.monotonic()
    run = plan.config.run
    runtime = make_runtime(plan, directory)
    with Supervisor(runtime, run, roster(runtime, simulations)) as supervisor:
        supervisor.start()
        with RunListener(reports.append) as listener:
            first = _until(supervisor, listener, reports, 1)
            watch = _Watch(supervisor, listener, reports)
            start, stop = watch.until(trials // 10), watch.until(trials * 9 // 10)
            memory = watch.memory_mb()
            watch.finish()
    size = sum(path.stat().st_size for path in directory.glob("*.mcap"))
    counted = stop.ended - start.ended
    return Collection(
        throws_per_s=counted / (stop.time_s - start.time_s),
        cpu_ms_per_throw={role: (stop.cpu_s[role] - start.cpu_s[role]) / counted * 1e3 for role in ROLES},
        disk_ms_per_throw=(stop.kernel_s["coordinator"] - start.kernel_s["coordinator"]) / counted * 1e3,
        memory_mb=memory,
        bytes_per_throw=size / trials,
        first_throw_s=first - began,
    )
