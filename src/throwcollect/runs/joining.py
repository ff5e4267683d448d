"""Adds simulations of this machine to a run of another machine; they may leave it again at any time."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.coordinator.onlooker import SILENT, Onlooker
from throwcollect.coordinator.progress import Progress
from throwcollect.dataset.carried_robot import unpack_robot
from throwcollect.errors import UnreachableError, WorkerError
from throwcollect.files import write_file
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey
from throwcollect.runs.token import JoinToken
from throwcollect.runtimes.local import LocalNodes
from throwcollect.runtimes.nodes import CONFIGURATION, LAUNCHER, ROBOT_FILES, simulation_name_of, simulation_nodes
from throwcollect.runtimes.runtime import RunContext
from throwcollect.runtimes.supervisor import Supervisor
from throwcollect.wording import format_count

_ANSWER_S = 15.0
"""Time in which the router, and then the launcher, has to answer."""
_POLL_S = 0.1
_SILENT_S = 120.0
"""If no report arrives for this long, the run counts as over. A shorter silence may be a failure of the network."""
_OVER_S = 5.0
"""The same time, for a run whose last trial has ended."""


def join_run(
    word: str,
    simulations: int,
    *,
    onlooker: Onlooker = SILENT,
    interruptions: Callable[[], int] = lambda: 0,
) -> None:
    """Simulate trials of a run that another machine has begun, until the run is over; `word` is the token of the run.

    If somebody asks to stop, which `interruptions` counts, simulations of other machines do the running trials again.
    """
    token = JoinToken.decode(word)
    token.check_build()
    with TemporaryDirectory(prefix="throwcollect-join-") as made:
        scratch = Path(made)
        key = RunKey(scratch / "key")
        key.create(bytes.fromhex(token.secret))
        connection = Connection(token.endpoint, key, token.domain_id)
        text, files = _read_configuration(connection, token)
        write_file(scratch / "config.yaml", text.encode())
        unpack_robot(files, scratch)
        config = load(scratch / "config.yaml")
        onlooker.say(f"run {token.run}: {format_count(simulations, 'simulation')} of this machine will join")
        context = RunContext(token.run, scratch, scratch / "logs", simulations, Middleware(), key)
        _simulate(LocalNodes(context, config, elsewhere=token.endpoint), connection, config, onlooker, interruptions)


def _simulate(
    host: LocalNodes, connection: Connection, config: Config, onlooker: Onlooker, interruptions: Callable[[], int]
) -> None:
    """Keep the simulations alive until the run is over."""
    from throwcollect.runtimes.run_listener import RunListener

    reports = _Reports(onlooker)
    # Names of nodes have to be unique, and several processes of one machine may join.
    name = simulation_name_of(f"{socket.gethostname()}_{os.getpid()}")
    roster = simulation_nodes([f"{name}_{index}" for index in range(host.context.simulations)], host.data)
    with Supervisor(host, config.run, roster) as supervisor, RunListener(reports.update) as listener:
        supervisor.start()
        while not reports.over and not interruptions():
            listener.spin(connection, _POLL_S)
            # The first value is the end of the main node, which is on another machine.
            _, news = supervisor.poll()
            for line in news:
                onlooker.warn(line)
    if interruptions():
        onlooker.say("left; the run goes on without the simulations of this machine")
    elif reports.finished:
        onlooker.say("the run is over")
    else:
        raise WorkerError(
            f"no report of the run has arrived for {_SILENT_S:g} s", hint="join it again if it still goes on"
        )


class _Reports:
    """Passes reports of the coordinator on, and concludes from them whether the run is over."""

    def __init__(self, onlooker: Onlooker) -> None:
        self._onlooker = onlooker
        self._last_at = time.monotonic()
        self.finished = False

    def update(self, progress: Progress) -> None:
        self._last_at = time.monotonic()
        self.finished = progress.steps[0] >= progress.steps[1]
        self._onlooker.update(progress)

    @property
    def over(self) -> bool:
        return time.monotonic() > self._last_at + (_OVER_S if self.finished else _SILENT_S)


def _read_configuration(connection: Connection, token: JoinToken) -> tuple[str, str]:
    """Ask the launcher of the run for the configuration, and for the files of its robot."""
    connection.middleware.joining.settle()
    from throwcollect.ros.srv import GetParameters
    from throwcollect.runtimes.run_listener import call_nodes

    request = GetParameters.Request(names=[CONFIGURATION, ROBOT_FILES])
    try:
        (response,) = call_nodes(
            connection, [f"/{LAUNCHER}"], GetParameters, "get_parameters", request, patience_s=_ANSWER_S
        )
    except UnreachableError as error:
        raise WorkerError(
            f"run {token.run}: {error.message}",
            hint="is that run over, or does a firewall keep its port closed? another run has another token",
        ) from error
    text, files = (value.string_value for value in response.values)
    return text, files
