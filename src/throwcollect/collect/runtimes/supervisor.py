"""Keeps the nodes of a run alive, on any host, until the coordinator has come to its end."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable, Iterable, Sequence

from throwcollect.collect.runtimes.nodes import NodeExit, NodeHost, NodeRole, NodeSpec
from throwcollect.collect.runtimes.run_record import NodeState, Status
from throwcollect.config.run import RunConfig
from throwcollect.errors import Interrupted, UnreachableError, WorkerError
from throwcollect.side_by_side import count_cores
from throwcollect.wording import format_count

_FIRST_BACKOFF_S = 0.2
_LONGEST_BACKOFF_S = 10.0
_CLOSING_S = 7.0
"""Time for the coordinator to write its files once the running trials have ended or were dropped."""
_FROZEN_S = 3.0
"""A node that is stopped for this long counts as lost. A shorter stop is allowed: a user may examine the node."""

_RESTARTS_BEFORE_READY = 1
"""A simulation that was never ready is started again only this often, because further attempts rarely help, unless it
only found no router."""


class Supervisor:
    """Keeps the nodes of one run alive; use it as a context manager, which closes the host and so ends all nodes.

    Args:
        roster: The nodes that the run is to have, in the order in which they are started; at most one is the main one.
    """

    def __init__(self, host: NodeHost, run: RunConfig, roster: Sequence[NodeSpec]) -> None:
        self.host = host
        self._run = run
        self._roster = {node.name: node for node in roster}
        self._restarts: dict[str, int] = {}
        self._last_end: dict[str, str] = {}
        self._due: dict[str, float] = {}
        self._given_up: dict[str, NodeExit] = {}
        self._ready: set[str] = set()
        self._has_worked: set[str] = set()
        """Simulations that were ready once, perhaps before their last start."""
        self._frozen_since: dict[str, float] = {}
        self._start_deadline = math.inf
        self._hung: frozenset[str] = frozenset()

    def __enter__(self) -> Supervisor:
        return self

    def __exit__(self, *_: object) -> None:
        self.host.close()

    def start(self) -> None:
        """Start all nodes, or as many as `_start_due` starts at a time."""
        self._start_deadline = time.monotonic() + self._run.start_timeout_s
        self._due = dict.fromkeys(self._roster, 0.0)
        self._start_due()

    def change(self, roster: Sequence[NodeSpec]) -> None:
        """Change the roster: start the nodes that are new, and end those that are not in it any more."""
        before, self._roster = self._roster, {node.name: node for node in roster}
        removed = [name for name in before if name not in self._roster]
        for name in removed:
            for memory in (self._restarts, self._last_end, self._due, self._given_up, self._frozen_since):
                memory.pop(name, None)
            self._ready.discard(name)
            self._has_worked.discard(name)
        self.host.stop(removed)
        for name in removed:
            # A later node of the same name does not count as ready because this one was.
            self.host.logs.skip(name)
        # If no simulation that was ready is left, the new ones need a new deadline: the old one may have passed.
        if not self._has_worked:
            self._start_deadline = time.monotonic() + self._run.start_timeout_s
        self._due |= {name: 0.0 for name in self._roster if name not in before}
        self._start_due()

    def poll(self) -> tuple[NodeExit | None, list[str]]:
        """Look after the nodes, and start again those that ended.

        Returns:
            How the main node ended (None while it runs), and a line for each event of other nodes since the last call.
        """
        end = None
        news = self._end_frozen()
        # Readiness is noted before ends are handled: a simulation that was ready once may be restarted more often.
        self._ready |= {name for name in self._expendables if name in self._ready or self.host.logs.said_ready(name)}
        self._has_worked |= self._ready
        for node in self.host.exits():
            self._last_end[node.name] = node.reason
            is_main = self._roster[node.name].role is NodeRole.MAIN
            if is_main and not (_may_go_on(node) and self._schedule_restart(node)):
                end = node
            elif is_main:
                news.append(f"{node.name} was lost ({node.reason}) and is started again")
            else:
                fate = "is started again" if self._schedule_restart(node) else "is given up"
                news.append(f"{node.name} was lost ({node.reason}) and {fate}{_quote_last_line(node)}")
        self._start_due()
        # Once the main node has come to its own end, the run needs no simulation any more.
        if end is None:
            self._check_that_run_can_go_on()
        return end, news

    def states(self) -> list[NodeState]:
        """All nodes of the run, in the order of the roster."""
        return [self._get_state(name) for name in self._roster]

    def replace(self, hung: Iterable[str]) -> None:
        """Kill the nodes that hang, so that they are started again, except those that the last call has killed."""
        known, self._hung = self._hung, frozenset(hung)
        for name in self._hung - known:
            self.host.signal(name, signal.SIGKILL)

    def drain(self, *, hurry: Callable[[], bool] = lambda: False) -> NodeExit | None:
        """Let the main node finish the running trials and close its files, unless `hurry` asks for its end now.

        Returns:
            How the main node ended; None if it had to be ended by force, or was about to be started again.
        """
        (main,) = self._list_names(NodeRole.MAIN)
        if main in self._due:
            return None
        self.host.signal(main, signal.SIGTERM)
        deadline = time.monotonic() + self._run.grace_s + _CLOSING_S
        while time.monotonic() < deadline and not hurry():
            for node in self.host.exits():
                if node.name == main:
                    return node
            time.sleep(0.02)
        self.host.stop([main], grace_s=0.0)
        return None

    def dismiss(self) -> None:
        """Ask the expendable nodes to end, and do not wait for that."""
        for name in self._expendables:
            self.host.signal(name, signal.SIGTERM)

    @property
    def _expendables(self) -> list[str]:
        return self._list_names(NodeRole.EXPENDABLE)

    def _list_names(self, role: NodeRole) -> list[str]:
        return [node.name for node in self._roster.values() if node.role is role]

    def _get_state(self, name: str) -> NodeState:
        handle = self.host.handle(name)
        status: Status = "running"
        if name in self._given_up:
            status = "lost"
        elif name in self._due or name not in self.host.running():
            status = "restarting" if name in self._restarts else "starting"
        elif name in self._frozen_since:
            status = "frozen"
        elif handle is None or (self._roster[name].role is NodeRole.EXPENDABLE and name not in self._ready):
            status = "starting"
        return NodeState(name, status, self._restarts.get(name, 0), handle, self._last_end.get(name))

    def _start_due(self) -> None:
        """Start the nodes that are due, but of simulations at most one a core at a time: the first is ready earlier."""
        now, room = time.monotonic(), count_cores() - len({*self._expendables} & {*self.host.running()} - self._ready)
        for name in [name for name, due in self._due.items() if due <= now]:
            is_simulation = name in self._expendables
            if is_simulation and room <= 0:
                continue
            room -= is_simulation
            del self._due[name]
            self.host.start(self._roster[name])

    def _end_frozen(self) -> list[str]:
        """Kill nodes that have been frozen for long; the result has a line for each of them."""
        now, news = time.monotonic(), []
        frozen = self.host.frozen()
        self._frozen_since = {name: self._frozen_since.get(name, now) for name in frozen}
        for name, since in self._frozen_since.items():
            if now - since >= _FROZEN_S:
                # Report each frozen node only once.
                self._frozen_since[name] = math.inf
                news.append(f"{name} is frozen (paused or stopped) and is ended")
                # A stopped process gets other signals only when it is continued, but SIGKILL at once.
                self.host.signal(name, signal.SIGKILL)
        return news

    def _schedule_restart(self, node: NodeExit) -> bool:
        """Plan the next start of a node that ended, or give the node up; return whether it will be started again."""
        count = self._restarts.get(node.name, 0)
        worked = self._roster[node.name].role is not NodeRole.EXPENDABLE or node.name in self._has_worked
        may_work = worked or node.code == UnreachableError.exit_code
        if count >= (self._run.restarts if may_work else min(_RESTARTS_BEFORE_READY, self._run.restarts)):
            self._given_up[node.name] = node
            return False
        self._restarts[node.name] = count + 1
        if node.name in self._ready:
            # What was printed until now does not count for the next start.
            self._ready.discard(node.name)
            self.host.logs.skip(node.name)
        rest = min(_FIRST_BACKOFF_S * 2**count, _LONGEST_BACKOFF_S)
        self._due[node.name] = time.monotonic() + max(rest, self._roster[node.name].rest_s)
        return True

    def _check_that_run_can_go_on(self) -> None:
        """Check that the run can go on."""
        hint = "throwcollect logs shows what the nodes printed"
        names = self._expendables
        vital = next(
            (self._given_up[name] for name in self._list_names(NodeRole.VITAL) if name in self._given_up), None
        )
        lost = [name for name in names if name in self._given_up]
        if vital is not None or (lost and len(lost) == len(names)):
            last = vital or self._given_up[lost[-1]]
            restarts = self._restarts.get(last.name, 0)
            what = f"the {last.name}" if vital else f"no simulation can be kept alive; the last, {last.name},"
            raise WorkerError(
                f"{what} ended again after {format_count(restarts, 'restart')}: {last.reason}",
                evidence=last.log or None,
                hint=hint,
            )
        if not self._has_worked and not any(map(self.host.handle, names)):
            # No container of a simulation runs yet, so the engine is slow. The host has a time limit for the engine, so
            # this deadline begins anew.
            self._start_deadline = time.monotonic() + self._run.start_timeout_s
        if names and not self._has_worked and time.monotonic() > self._start_deadline:
            raise WorkerError(
                f"no simulation was ready within {self._run.start_timeout_s:g} s (run.start_timeout_s)",
                evidence=self.host.logs.tail(names[0]) or None,
                hint=hint,
            )


def _may_go_on(node: NodeExit) -> bool:
    """Whether the main node may come to its end if it is started again: it was killed, or did not find the router.

    The router is started again as well, but on a busy machine it may come too late for a node that starts meanwhile.
    """
    if node.code is None:
        return False
    # No node itself returns the exit code of one that was killed. A killed process has minus the number of the signal
    # as its exit code, a container 128 plus the number. In a container, 130 would be SIGINT, but a node that was
    # interrupted also returns 130, so it does not count.
    was_killed = node.code < 0 or node.code > Interrupted.exit_code
    return was_killed or node.code == UnreachableError.exit_code


def _quote_last_line(node: NodeExit) -> str:
    # Lines that belong to a message, such as its hint, are indented; those below a message of Rust have a label.
    lines = [line for line in node.log.splitlines() if not line.startswith((" ", "note: "))]
    return f"; its log ends: {lines[-1]}" if lines else ""
