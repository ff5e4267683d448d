"""One run from start to end: a router, simulations that are kept alive, a coordinator that is waited for."""

from __future__ import annotations

import math
import os
import signal
import socket
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from types import TracebackType

from throwcollect.config.schema import RunConfig
from throwcollect.errors import ConfigError, WorkerError
from throwcollect.runtime.local import LocalRuntime, NodeExit

_HOST = "127.0.0.1"
_ROUTER = "router"
_COORDINATOR = "coordinator"
_FIRST_BACKOFF_S = 0.2
_LONGEST_BACKOFF_S = 10.0
_DRAIN_S = 15.0
"""Time that a coordinator gets to finish its running trials after it was told to stop."""


_RESTARTS_BEFORE_READY = 1
"""A node that has never worked will hardly do so at the tenth attempt."""
_CONNECT_S = 0.1


def _reserved_port(wanted: int) -> socket.socket:
    """A socket that keeps a port until it is closed."""
    probe = socket.socket()
    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        probe.bind((_HOST, wanted))
    except OSError as error:
        probe.close()
        raise ConfigError(
            f"run.router_port: port {wanted} of {_HOST} cannot be used: {error.strerror}",
            hint="--set run.router_port=0 takes a free one",
        ) from error
    return probe


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
        # Where simulations fill all cores, moving them around was measured to cost about a tenth of the speed.
        cores = sorted(os.sched_getaffinity(0))
        bound = simulations >= len(cores)
        self._cores = {name: cores[k % len(cores)] if bound else None for k, name in enumerate(self._simulations)}
        self._restarts = dict.fromkeys((_ROUTER, *self._simulations), 0)
        self._due: dict[str, float] = {}
        self._given_up: dict[str, NodeExit] = {}
        self._ready: set[str] = set()
        self._start_deadline = math.inf
        self._hung: frozenset[str] = frozenset()
        self._reserved = _reserved_port(run.router_port)
        self._address: tuple[str, int] = self._reserved.getsockname()
        self.endpoint = f"tcp/{_HOST}:{self._address[1]}"
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
        self._reserved.close()
        names = [name for name in self.runtime.running() if name != _ROUTER]
        self.runtime.stop(names)
        self.runtime.stop([_ROUTER])

    def start(self) -> None:
        """Start all nodes.

        Raises:
            WorkerError: If a process cannot be started.
        """
        self._reserved.close()
        self._start_deadline = time.monotonic() + self._run.start_timeout_s
        for name in (_ROUTER, *self._simulations):
            self._start(name)
        self.runtime.start(_COORDINATOR, ["coordinator", str(self._directory)])

    def router_answers(self) -> bool:
        """Whether nodes can connect to the router by now."""
        try:
            socket.create_connection(self._address, _CONNECT_S).close()
        except OSError:
            return False
        return True

    def poll(self) -> tuple[NodeExit | None, list[str]]:
        """Look after the nodes: restart what died.

        Returns:
            How the coordinator ended, None while it runs; and what happened to other nodes since the last call.

        Raises:
            WorkerError: If no simulation was ready in time, or the router or all simulations are lost for good; with
                the evidence.
        """
        end = None
        news = []
        self._ready |= {name for name in self._simulations if name not in self._ready and self._was_ready(name)}
        for node in self.runtime.exits():
            if node.name == _COORDINATOR:
                end = node
            else:
                fate = "is started again" if self._schedule_restart(node) else "is given up"
                news.append(f"{node.name} was lost ({node.reason}) and {fate}")
        now = time.monotonic()
        for name in [name for name, due in self._due.items() if due <= now]:
            del self._due[name]
            self._start(name)
        if end is None:
            self._check_hope()
        return end, news

    def replace(self, hung: Iterable[str]) -> None:
        """End simulations by force that do not answer any more, so that they are started again.

        Args:
            hung: Names of all of which that is known; each is ended once until it is missing here again.
        """
        known, self._hung = self._hung, frozenset(hung)
        for name in self._hung - known:
            self.runtime.signal(name, signal.SIGKILL)

    def drain(self, *, hurry: Callable[[], bool] = lambda: False) -> NodeExit | None:
        """Let the coordinator finish its running trials and close its files.

        Args:
            hurry: Asked again and again whether to end at once.

        Returns:
            How it ended; None when it had to be ended by force.
        """
        self.runtime.signal(_COORDINATOR, signal.SIGINT)
        deadline = time.monotonic() + _DRAIN_S
        while time.monotonic() < deadline and not hurry():
            for node in self.runtime.exits():
                if node.name == _COORDINATOR:
                    return node
            time.sleep(0.02)
        self.runtime.stop([_COORDINATOR], grace_s=0.0)
        return None

    def _start(self, name: str) -> None:
        if name == _ROUTER:
            self.runtime.start(name, ["router", "--listen", self.endpoint])
        else:
            arguments = ["sim", str(self._directory / "config.yaml"), "--name", name]
            self.runtime.start(name, arguments, core=self._cores[name])

    def _was_ready(self, name: str) -> bool:
        return self.runtime.said(name, f"{name} is ready")

    def _schedule_restart(self, node: NodeExit) -> bool:
        """Whether a node that ended will be started again."""
        count = self._restarts[node.name]
        worked = node.name == _ROUTER or node.name in self._ready
        if count >= (self._run.restarts if worked else min(_RESTARTS_BEFORE_READY, self._run.restarts)):
            self._given_up[node.name] = node
            return False
        self._restarts[node.name] = count + 1
        self._due[node.name] = time.monotonic() + min(_FIRST_BACKOFF_S * 2**count, _LONGEST_BACKOFF_S)
        return True

    def _check_hope(self) -> None:
        hint = f"look into {self._directory / 'logs'}"
        router = self._given_up.get(_ROUTER)
        if router is not None or len(self._given_up) == len(self._simulations):
            last = router or list(self._given_up.values())[-1]
            restarts = self._restarts[last.name]
            what = "the router" if router else f"no simulation can be kept alive; the last, {last.name},"
            raise WorkerError(
                f"{what} ended again after {restarts} restart{'' if restarts == 1 else 's'}: {last.reason}",
                evidence=last.log or None,
                hint=hint,
            )
        if not self._ready and time.monotonic() > self._start_deadline:
            raise WorkerError(
                f"no simulation was ready within {self._run.start_timeout_s:g} s (run.start_timeout_s)",
                evidence=self.runtime.log_tail(self._simulations[0]) or None,
                hint=hint,
            )
