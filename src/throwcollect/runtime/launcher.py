"""The launcher of a run: keeps its nodes alive, remembers what happens, and obeys those who ask over ROS 2.

It is the node ``/launcher``; setting its integer parameter ``simulations`` scales the run.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Union

from throwcollect import ros
from throwcollect.config.schema import Config
from throwcollect.coordinator.progress import Progress
from throwcollect.dataset.inspect import info, loss
from throwcollect.dataset.lock import held_together
from throwcollect.errors import ConfigError, DatasetError, Interrupted, LossError, ThrowcollectError, WorkerError
from throwcollect.ros.fast_dds import SERVER_REST_S
from throwcollect.run_key import RunKey
from throwcollect.runtime.events import EventLog, RunEvent
from throwcollect.runtime.local import LocalRuntime
from throwcollect.runtime.nodes import COORDINATOR, LAUNCHER, ROUTER, NodeExit, endpoint_of
from throwcollect.runtime.records import OpenRun, Record
from throwcollect.runtime.run_listener import RunListener
from throwcollect.runtime.runs import goes_on
from throwcollect.runtime.scaling import MOST_SIMULATIONS, offer_scaling
from throwcollect.runtime.supervisor import NodeState, Supervisor
from throwcollect.wording import command

if TYPE_CHECKING:
    from throwcollect.runtime.docker import DockerRuntime

Place = Union[LocalRuntime, "DockerRuntime"]
"""Where the nodes of a run live."""

_POLL_S = 0.05
_WRITE_PROGRESS_S = 1.0
_MEET_S = 12.0
"""Nodes that are ready see each other within a second."""


class Onlooker(Protocol):
    """Is told what goes on."""

    def update(self, progress: Progress) -> None:
        """A progress report of the coordinator."""

    def say(self, line: str) -> None:
        """Something that is good to know."""

    def warn(self, line: str) -> None:
        """Something that went wrong."""


def place_of(record: Record, config: Config, key: RunKey, *, warn: Callable[[str], None]) -> Place:
    """The place where the nodes of a run are to live, or live already.

    Args:
        record: What is known of the run.
        config: Its configuration.
        key: Its key.
        warn: Is told in one line when the place keeps everybody waiting.

    Raises:
        ConfigError: If the router's port is taken, or something that the configuration asks for is not there.
        WorkerError: If there is no such place on this machine.
    """
    if record.runtime == "local":
        return LocalRuntime(Path(record.directory), Path(record.logs), config.run, key, record.middleware)
    from throwcollect.runtime.docker import DockerRuntime

    directory = None if record.volume else Path(record.directory)
    return DockerRuntime(
        record.run,
        config,
        directory=directory,
        logs=Path(record.logs),
        key=key,
        middleware=record.middleware,
        warn=warn,
    )


def launch(
    run: OpenRun,
    config: Config,
    *,
    onlooker: Onlooker,
    interruptions: Callable[[], int],
) -> tuple[Mapping[str, Any], LossError | None]:
    """Run a prepared collection until its coordinator ends, or go on with one whose launcher died.

    Args:
        run: The run, with a record; its end is written there, and the run is let go of.
        config: Configuration of the collection.
        onlooker: Is told what goes on.
        interruptions: How often the user has asked to stop: at first running trials are finished, then no more.

    Returns:
        What the dataset holds, as `dataset info` says it, and ``open``: whether anybody could join the run; and the
        error that says that trials are lost, if some are.

    Raises:
        ConfigError: If the configuration cannot be used after all.
        WorkerError: If nodes cannot be started or kept alive.
        DatasetError: If another process changes the dataset, or it cannot be written.
        Interrupted: If the user stopped the collection.
    """
    notes = _Notes(run, onlooker)
    code, message, summary = 1, "internal error", None
    place: Place | None = None
    try:
        place = place_of(run.record, config, run.key, warn=onlooker.warn)
        with held_together(Path(run.record.directory)):
            summary = _Launcher(run, config, place, notes, onlooker, interruptions).run_to_the_end()
        lost = loss(summary["outcomes"], hint=goes_on(run.record))
        code, message = (0, "") if lost is None else (lost.exit_code, str(lost))
        return summary, lost
    except ThrowcollectError as error:
        code, message = error.exit_code, str(error)
        raise
    finally:
        # What was there before may be there still, if it could not even be looked for.
        left = run.record.left if place is None else not place.cleared
        if left:
            onlooker.warn(f"containers of this run may be left: {command('down', '--run', run.run)} ends them")
        notes.end(code, message, summary, left=left)
        run.close()


class _Notes:
    """Writes down what happens in a run; where that is impossible, the run itself may still go on."""

    def __init__(self, run: OpenRun, onlooker: Onlooker) -> None:
        self._run = run
        self._onlooker = onlooker
        self._events = EventLog(Path(run.record.logs), run.run)
        self._states: list[NodeState] = []
        self._progress: Progress | None = None
        self._written_at = 0.0
        self._failed = False

    def progress(self, progress: Progress) -> None:
        """A progress report of the coordinator, to be written with what comes next."""
        self._progress = progress

    def event(self, event: RunEvent, **details: Any) -> None:
        """Something that happened to the run."""
        self._write(lambda: self._events.run_event(event, **details))

    def known(self, states: list[NodeState]) -> None:
        """Nodes of which a launcher before this one has written."""
        self._states = states

    def nodes(self, states: list[NodeState], *, endpoint: str | None, simulations: int) -> None:
        """How the nodes are by now."""
        if states != self._states:
            before, self._states = self._states, states
            self._write(lambda: self._events.node_events(before, states))
        trials = {}
        if time.monotonic() >= self._written_at + _WRITE_PROGRESS_S:
            self._written_at = time.monotonic()
            trials = self._trials()
        self._write(lambda: self._run.update(nodes=tuple(states), endpoint=endpoint, simulations=simulations, **trials))

    def end(self, code: int, message: str, summary: dict[str, Any] | None, *, left: bool) -> None:
        """How the run ended, last of all, and whether containers of it may be left."""
        event: RunEvent = "failed"
        if code in (0, LossError.exit_code):
            event = "finished"
        elif code == Interrupted.exit_code:
            event = "stopped"
        self.event(event, reason=message or None, exit_code=code)
        end = {
            "ended": datetime.now(timezone.utc),
            "exit_code": code,
            "message": message,
            "summary": summary,
            "left": left,
        }
        self._write(lambda: self._run.update(nodes=(), endpoint=None, **end, **self._trials()))

    def _trials(self) -> dict[str, int]:
        progress = self._progress
        return {} if progress is None else {"trials": progress.total, "trials_ended": progress.ended}

    def _write(self, write: Callable[[], None]) -> None:
        try:
            write()
        except (OSError, ConfigError) as error:
            if not self._failed:
                self._failed = True
                reason = error.message if isinstance(error, ConfigError) else str(error)
                self._onlooker.warn(f"what happens in this run is not written down any more: {reason}")


class _Launcher:
    """What `launch` does until the nodes have ended."""

    def __init__(
        self,
        run: OpenRun,
        config: Config,
        place: Place,
        notes: _Notes,
        onlooker: Onlooker,
        interruptions: Callable[[], int],
    ) -> None:
        self._run = run
        self._notes = notes
        self._onlooker = onlooker
        self._interruptions = interruptions
        self._is_open = config.run.open
        self._most = 1 if config.run.root_namespace else MOST_SIMULATIONS
        self._simulations = self._wanted = run.record.simulations
        self._set_aside: set[str] = set()
        self._apart_since = math.inf
        self._started_again = False
        self._place = place
        rest_s = SERVER_REST_S if run.record.middleware.is_fast_dds else 0.0
        self._supervisor = Supervisor(self._place, config.run, simulations=self._simulations, router_rest_s=rest_s)
        self._listener = RunListener(
            self._report,
            domain_id=run.record.domain_id,
            key=run.key,
            middleware=run.record.middleware,
            name=LAUNCHER,
            on_connect=self._offer_scaling,
        )

    def run_to_the_end(self) -> dict[str, Any]:
        self._run.update(launcher=os.getpid(), nodes=(), endpoint=None)
        with self._supervisor, self._listener:
            found = self._open()
            self._notes.event("adopted" if found else "started", simulations=self._simulations)
            self._supervisor.start(found=found)
            self._notes.known([state for state in self._supervisor.states() if state.name in found])
            self._check(self._follow())
            return {**self._summary(), "open": self._is_open}

    def _open(self) -> tuple[str, ...]:
        """Make what the nodes need; names of those that a launcher before this one has left."""
        if isinstance(self._place, LocalRuntime):
            return ()
        self._place.open()
        found = self._place.found()
        record = self._run.record
        if record.volume is not None and not found:
            self._place.place(Path(record.directory))
        return found

    def _follow(self) -> NodeExit | None:
        """How the coordinator ended; None when it had to be ended by force."""
        end = None
        while end is None and not self._interruptions():
            self._listen()
            if self._wanted != self._simulations:
                self._simulations = self._wanted
                self._notes.event("scaled", simulations=self._simulations)
                self._supervisor.scale(self._simulations)
            end, news = self._supervisor.poll()
            for line in news:
                self._onlooker.warn(line)
            states = self._supervisor.states()
            self._notes.nodes(states, endpoint=endpoint_of(self._place), simulations=self._simulations)
        if end is None:
            self._notes.event("stopping")
            self._onlooker.say("interrupted: finishing the running trials; once more ends at once")
            end = self._supervisor.drain(hurry=lambda: self._interruptions() > 1)
        self._listen()
        return end

    def _check(self, end: NodeExit | None) -> None:
        finished = end is not None and end.code in (0, LossError.exit_code)
        if self._interruptions() and not finished:
            dataset = self._run.record.dataset
            message = f"interrupted; finished throws are in {dataset}, the dataset is not complete"
            raise Interrupted(message, hint=goes_on(self._run.record))
        if end is not None and not finished:
            kind = DatasetError if end.code == DatasetError.exit_code else WorkerError
            hint = goes_on(self._run.record) if kind is WorkerError else None
            raise kind(f"the coordinator stopped: {end.reason}", evidence=end.log or None, hint=hint)

    def _summary(self) -> dict[str, Any]:
        record = self._run.record
        if record.volume is not None and not isinstance(self._place, LocalRuntime):
            return self._place.info()
        return info(Path(record.directory)).as_dict()

    def _listen(self) -> None:
        self._listener.spin(endpoint_of(self._place), _POLL_S)

    def _report(self, progress: Progress) -> None:
        self._notes.progress(progress)
        self._check_that_nodes_meet(progress)
        self._onlooker.update(progress)
        self._supervisor.replace(progress.hung)
        for name in progress.set_aside.keys() - self._set_aside:
            self._set_aside.add(name)
            self._onlooker.warn(
                f"{name} gets no more trials, as others could do what it refused: {progress.set_aside[name]}"
            )

    def _check_that_nodes_meet(self, progress: Progress) -> None:
        """Start nodes again that do not see each other: on DDS that happens, and they do at the next try.

        Raises:
            WorkerError: If that did not help; the run would go on for ever with nothing done.
        """
        states = self._supervisor.states()
        ready = any(state.status == "running" for state in states if state.name not in (ROUTER, COORDINATOR))
        if progress.simulations or progress.ended or not ready:
            self._apart_since = math.inf
            return
        self._apart_since = min(self._apart_since, time.monotonic())
        if time.monotonic() - self._apart_since <= _MEET_S:
            return
        if not self._started_again:
            self._started_again = True
            self._onlooker.warn("the coordinator does not see the simulations; all of them are started again")
            self._supervisor.replace([state.name for state in states if state.name != ROUTER])
        else:
            raise WorkerError(
                f"simulations have been ready for {_MEET_S:g} s, twice, but the coordinator does not see them",
                evidence=f"they use {self._run.record.middleware.rmw}, and the router at {endpoint_of(self._place)}",
                hint="a firewall may keep nodes apart; throwcollect doctor shows what is installed",
            )

    def _offer_scaling(self, node: ros.Node) -> None:
        offer_scaling(node, self._simulations, self._want, most=self._most)

    def _want(self, simulations: int) -> None:
        # Not done here: whoever asks shall not have to wait for nodes that are slow to end.
        self._wanted = simulations
