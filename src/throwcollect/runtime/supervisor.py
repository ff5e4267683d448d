"""One run from start to end: a router, simulations that are kept alive, a coordinator that is waited for."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import Literal

from throwcollect.config.run import RunConfig
from throwcollect.errors import Interrupted, WorkerError
from throwcollect.runtime.nodes import COORDINATOR, ROUTER, NodeExit, Runtime, simulation_name
from throwcollect.wording import counted

_FIRST_BACKOFF_S = 0.2
_LONGEST_BACKOFF_S = 10.0
_CLOSING_S = 7.0
"""Time that a coordinator gets to write its files once the running trials have ended or were dropped."""
_FROZEN_S = 3.0
"""Somebody may stop a node to look at it; after this time it counts as lost."""

_RESTARTS_BEFORE_READY = 1
"""A node that has never worked will hardly do so at the tenth attempt."""


@dataclass(frozen=True)
class NodeState:
    """What is known of one node.

    Attributes:
        name: Its name.
        status: ``starting`` until a simulation is ready, ``running``, ``frozen``, ``restarting`` (it ended and waits
            for its next start), or ``lost`` for good.
        restarts: How often it was started again.
        handle: Process or container id; None if it does not run.
        last_end: How it ended last, in words; None if it never did.
    """

    name: str
    status: Literal["starting", "running", "frozen", "restarting", "lost"]
    restarts: int
    handle: str | None
    last_end: str | None


class Supervisor:
    """Keeps the nodes of one run alive; use it as a context manager, so that none is left behind.

    Args:
        runtime: Where the nodes live; closed at the end.
        run: How to run.
        simulations: Number of simulations.
        router_rest_s: Shortest time after which a router that ended is started again [s].
    """

    def __init__(self, runtime: Runtime, run: RunConfig, *, simulations: int, router_rest_s: float = 0.0) -> None:
        self.runtime = runtime
        self._run = run
        self._router_rest_s = router_rest_s
        self._simulations: tuple[str, ...] = tuple(map(simulation_name, range(simulations)))
        self._restarts: dict[str, int] = {}
        self._last_end: dict[str, str] = {}
        self._due: dict[str, float] = {}
        self._given_up: dict[str, NodeExit] = {}
        self._ready: set[str] = set()
        self._frozen_since: dict[str, float] = {}
        self._start_deadline = math.inf
        self._hung: frozenset[str] = frozenset()

    def __enter__(self) -> Supervisor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.runtime.close()

    def start(self, *, found: Collection[str] = ()) -> None:
        """Start all nodes.

        Args:
            found: Nodes that run already, of a launcher that died.

        Raises:
            WorkerError: If a node cannot be started.
        """
        self._start_deadline = time.monotonic() + self._run.start_timeout_s
        for name in (ROUTER, *self._simulations, COORDINATOR):
            if name not in found:
                self._start(name)

    def scale(self, simulations: int) -> None:
        """Change the number of simulations: start more, or end the last ones; their trials go to others.

        Raises:
            WorkerError: If a node cannot be started.
        """
        names = tuple(map(simulation_name, range(simulations)))
        added = [name for name in names if name not in self._simulations]
        removed = [name for name in self._simulations if name not in names]
        self._simulations = names
        for name in removed:
            for memory in (self._restarts, self._last_end, self._due, self._given_up, self._frozen_since):
                memory.pop(name, None)
            self._ready.discard(name)
        self.runtime.stop(removed)
        if not self._ready:
            self._start_deadline = time.monotonic() + self._run.start_timeout_s
        for name in added:
            self._start(name)

    def poll(self) -> tuple[NodeExit | None, list[str]]:
        """Look after the nodes: restart what died.

        Returns:
            How the coordinator ended, None while it runs; and what happened to other nodes since the last call.

        Raises:
            WorkerError: If no simulation was ready in time, or the router or all simulations are lost for good; with
                the evidence.
        """
        end = None
        news = self._end_frozen()
        self._ready |= {name for name in self._simulations if name not in self._ready and self.runtime.ready(name)}
        for node in self.runtime.exits():
            self._last_end[node.name] = node.reason
            if node.name == COORDINATOR and not (_killed(node) and self._schedule_restart(node)):
                end = node
            elif node.name == COORDINATOR:
                news.append(f"{node.name} was lost ({node.reason}) and is started again")
            else:
                fate = "is started again" if self._schedule_restart(node) else "is given up"
                news.append(f"{node.name} was lost ({node.reason}) and {fate}{_last_words(node)}")
        now = time.monotonic()
        for name in [name for name, due in self._due.items() if due <= now]:
            del self._due[name]
            self._start(name)
        if end is None:
            self._check_hope()
        return end, news

    def states(self) -> list[NodeState]:
        """All nodes of the run: the router, the simulations, the coordinator."""
        return [self._state(name) for name in (ROUTER, *self._simulations, COORDINATOR)]

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
            How it ended; None when it had to be ended by force, or was about to be started again.
        """
        if COORDINATOR in self._due:
            return None
        self.runtime.signal(COORDINATOR, signal.SIGINT)
        deadline = time.monotonic() + self._run.grace_s + _CLOSING_S
        while time.monotonic() < deadline and not hurry():
            for node in self.runtime.exits():
                if node.name == COORDINATOR:
                    return node
            time.sleep(0.02)
        self.runtime.stop([COORDINATOR], grace_s=0.0)
        return None

    def _start(self, name: str) -> None:
        data = self.runtime.data
        if name == ROUTER:
            self.runtime.start(name, ["router", "--listen", self.runtime.listen])
        elif name == COORDINATOR:
            self.runtime.start(name, ["coordinator", data])
        else:
            self.runtime.start(name, ["sim", f"{data}/config.yaml", "--name", name], core=self._core(name))

    def _core(self, name: str) -> int | None:
        """Where simulations fill all cores, moving them around was measured to cost about a tenth of the speed."""
        cores = sorted(os.sched_getaffinity(0))
        if len(self._simulations) < len(cores):
            return None
        return cores[self._simulations.index(name) % len(cores)]

    def _state(self, name: str) -> NodeState:
        handle = self.runtime.handle(name)
        status: Literal["starting", "running", "frozen", "restarting", "lost"] = "running"
        if name in self._given_up:
            status = "lost"
        elif name in self._due or name not in self.runtime.running():
            status = "restarting"
        elif name in self._frozen_since:
            status = "frozen"
        elif handle is None or (name in self._simulations and name not in self._ready):
            status = "starting"
        return NodeState(name, status, self._restarts.get(name, 0), handle, self._last_end.get(name))

    def _end_frozen(self) -> list[str]:
        """End nodes by force that have been frozen for long."""
        now, news = time.monotonic(), []
        frozen = self.runtime.frozen()
        self._frozen_since = {name: self._frozen_since.get(name, now) for name in frozen}
        for name, since in self._frozen_since.items():
            if now - since >= _FROZEN_S:
                # Report each frozen node only once.
                self._frozen_since[name] = math.inf
                news.append(f"{name} is frozen (paused or stopped) and is ended")
                self.runtime.signal(name, signal.SIGKILL)
        return news

    def _schedule_restart(self, node: NodeExit) -> bool:
        """Whether a node that ended will be started again."""
        count = self._restarts.get(node.name, 0)
        worked = node.name in (ROUTER, COORDINATOR) or node.name in self._ready
        if count >= (self._run.restarts if worked else min(_RESTARTS_BEFORE_READY, self._run.restarts)):
            self._given_up[node.name] = node
            return False
        self._restarts[node.name] = count + 1
        rest = min(_FIRST_BACKOFF_S * 2**count, _LONGEST_BACKOFF_S)
        self._due[node.name] = time.monotonic() + (max(rest, self._router_rest_s) if node.name == ROUTER else rest)
        return True

    def _check_hope(self) -> None:
        hint = "throwcollect logs shows what the nodes said"
        router = self._given_up.get(ROUTER)
        lost = [name for name in self._simulations if name in self._given_up]
        if router is not None or (lost and len(lost) == len(self._simulations)):
            last = router or self._given_up[lost[-1]]
            restarts = self._restarts.get(last.name, 0)
            what = "the router" if router else f"no simulation can be kept alive; the last, {last.name},"
            raise WorkerError(
                f"{what} ended again after {counted(restarts, 'restart')}: {last.reason}",
                evidence=last.log or None,
                hint=hint,
            )
        if not self._ready and not any(map(self.runtime.handle, self._simulations)):
            # None of them runs yet: it is the engine that takes its time, and it has a patience of its own.
            self._start_deadline = time.monotonic() + self._run.start_timeout_s
        if self._simulations and not self._ready and time.monotonic() > self._start_deadline:
            raise WorkerError(
                f"no simulation was ready within {self._run.start_timeout_s:g} s (run.start_timeout_s)",
                evidence=self.runtime.log_tail(self._simulations[0]) or None,
                hint=hint,
            )


def _killed(node: NodeExit) -> bool:
    """Whether a node was ended from outside, and not by itself: its exit code is no number that it could return."""
    return node.code is not None and (node.code < 0 or node.code > Interrupted.exit_code)


def _last_words(node: NodeExit) -> str:
    lines = node.log.splitlines()
    return f"; its log ends: {lines[-1]}" if lines else ""
