"""One run from start to end: a router, simulations that are kept alive, a coordinator that is waited for."""

from __future__ import annotations

import os
import signal
import socket
import time
from pathlib import Path
from types import TracebackType

from throwcollect.config.schema import RunConfig
from throwcollect.errors import ConfigError, WorkerError
from throwcollect.runtime.local import LocalRuntime, NodeExit

_ROUTER = "router"
_COORDINATOR = "coordinator"
_FIRST_BACKOFF_S = 0.2
_LONGEST_BACKOFF_S = 10.0
_DRAIN_S = 15.0
"""Time that a coordinator gets to finish its running trials after it was told to stop."""


def _free_port(wanted: int) -> int:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", wanted))
        except OSError as error:
            raise ConfigError(
                f"run.router_port: port {wanted} of 127.0.0.1 cannot be used: {error.strerror}",
                hint="--set run.router_port=0 takes a free one",
            ) from error
        return int(probe.getsockname()[1])


class Supervisor:
    """The processes of one run; use it as a context manager, so that none is left behind.

    Args:
        directory: Directory of the dataset, holding `config.yaml` and `plan.parquet`; logs go to its `logs/`.
        run: How to run.
        simulations: Number of simulations.

    Raises:
        ConfigError: If the router's port is taken.
    """

    def __init__(self, directory: Path, run: RunConfig, *, simulations: int) -> None:
        self._directory = directory
        self._run = run
        self._simulations = tuple(f"sim_{index}" for index in range(simulations))
        # Where simulations fill all cores, moving them around costs them their caches: about a tenth of the speed.
        cores = sorted(os.sched_getaffinity(0))
        bound = simulations >= len(cores)
        self._cores = {name: cores[k % len(cores)] if bound else None for k, name in enumerate(self._simulations)}
        self._restarts = dict.fromkeys(self._simulations, 0)
        self._due: dict[str, float] = {}
        self._given_up: list[NodeExit] = []
        self.endpoint = f"tcp/127.0.0.1:{_free_port(run.router_port)}"
        self.environment = {
            "ZENOH_CONFIG_OVERRIDE": f'mode="client";connect/endpoints=["{self.endpoint}"]',
            "ROS_DOMAIN_ID": str(run.domain_id),
            # One process per core is the parallelism here; threads of numerical libraries would only fight it.
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }
        self.runtime = LocalRuntime(directory / "logs", self.environment)

    def __enter__(self) -> Supervisor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        names = [name for name in self.runtime.running() if name != _ROUTER]
        self.runtime.stop(names)
        self.runtime.stop([_ROUTER])

    def start(self) -> None:
        """Start all nodes.

        Raises:
            WorkerError: If a process cannot be started.
        """
        self.runtime.start(_ROUTER, ["router", "--listen", self.endpoint])
        for name in self._simulations:
            self._start_simulation(name)
        self.runtime.start(_COORDINATOR, ["coordinator", str(self._directory)])

    def poll(self) -> tuple[int | None, list[NodeExit]]:
        """Look after the nodes: restart what died.

        Returns:
            Exit code of the coordinator, None while it runs; and the nodes that were lost since the last call.

        Raises:
            WorkerError: If the router was lost for good, or no simulation can be kept alive, with the evidence.
        """
        code = None
        lost = []
        for node in self.runtime.exits():
            if node.name == _COORDINATOR:
                code = node.code
                continue
            lost.append(node)
            if node.name == _ROUTER:
                self.runtime.start(_ROUTER, ["router", "--listen", self.endpoint])
            else:
                self._schedule_restart(node)
        now = time.monotonic()
        for name in [name for name, due in self._due.items() if due <= now]:
            del self._due[name]
            self._start_simulation(name)
        if code is None and len(self._given_up) == len(self._simulations):
            last = self._given_up[-1]
            raise WorkerError(
                f"no simulation can be kept alive; the last, {last.name}, was restarted "
                f"{self._restarts[last.name]} times: {last.reason}",
                evidence=last.log or None,
                hint=f"look into {self._directory / 'logs'}",
            )
        return code, lost

    def drain(self) -> int:
        """Let the coordinator finish its running trials and close its files.

        Returns:
            Its exit code.
        """
        self.runtime.signal(_COORDINATOR, signal.SIGINT)
        deadline = time.monotonic() + _DRAIN_S
        while time.monotonic() < deadline:
            code, _ = self.poll()
            if code is not None:
                return code
            time.sleep(0.02)
        self.runtime.stop([_COORDINATOR])
        return -signal.SIGTERM

    def coordinator_log(self) -> str:
        """Last lines that the coordinator printed."""
        return self.runtime.log_tail(_COORDINATOR)

    def _start_simulation(self, name: str) -> None:
        arguments = ["sim", str(self._directory / "config.yaml"), "--name", name]
        self.runtime.start(name, arguments, core=self._cores[name])

    def _schedule_restart(self, node: NodeExit) -> None:
        count = self._restarts[node.name]
        if count >= self._run.restarts:
            self._given_up.append(node)
            return
        self._restarts[node.name] = count + 1
        self._due[node.name] = time.monotonic() + min(_FIRST_BACKOFF_S * 2**count, _LONGEST_BACKOFF_S)
