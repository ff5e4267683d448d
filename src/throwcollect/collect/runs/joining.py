"""Adds simulations of this machine to a run of another machine, by its token; they may leave it again at any time."""

from __future__ import annotations

import base64
import os
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from pydantic import TypeAdapter

from throwcollect.build import build_digest
from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.coordinator.reporter import SILENT, Reporter
from throwcollect.collect.runtimes.local import LocalNodes
from throwcollect.collect.runtimes.nodes import (
    CONFIGURATION,
    LAUNCHER,
    ROBOT_FILES,
    list_simulations,
    name_simulation_on,
)
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.collect.runtimes.supervisor import Supervisor
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.dataset.carried_robot import unpack_robot
from throwcollect.errors import ConfigError, UnreachableError, WorkerError
from throwcollect.files import write_file
from throwcollect.plan.conditions import build_of
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router_endpoint import split_address
from throwcollect.run_key import RunKey
from throwcollect.wording import format_count

_START = "tc3."
"""Beginning of every token; the number is the version of the format."""
_ANSWER_S = 15.0
"""Time in which the router, and then the launcher, has to answer."""
_POLL_S = 0.1
_SILENT_S = 120.0
"""If no report arrives for this long, the run counts as over. A shorter silence may be a failure of the network."""
_OVER_S = 5.0
"""The same time, for a run whose last trial has ended."""


@dataclass(frozen=True)
class JoinToken:
    """The facts of a run that another machine needs to join it. It holds the key of the run, so it is a secret, too.

    Attributes:
        endpoint: Endpoint at which other machines reach the router.
        secret: Secret of the key of the run, in hexadecimal.
        parts: Engine, robot, tool, task and policy of the run, as arguments of `build_digest`.
        build: Digest over the code that computes the run's throws with these; see `throwcollect.build`.
    """

    run: str
    endpoint: str
    secret: str
    domain_id: int
    parts: tuple[str, ...]
    build: str

    @classmethod
    def of(cls, run: str, endpoint: str, key: RunKey, config: Config) -> JoinToken:
        """Make the token of a run with this configuration."""
        policy = config.task.policy.use if config.task.policy else ""
        parts = config.sim.engine, config.robot.name, config.tool.name, config.task.name, policy
        return cls(run, endpoint, key.secret.hex(), config.run.domain_id, parts, build_of(config))

    def encode(self) -> str:
        """The token as one word."""
        return _START + base64.urlsafe_b64encode(_JSON.dump_json(self)).decode().rstrip("=")

    @classmethod
    def decode(cls, word: str) -> JoinToken:
        """Read a token."""
        start, _, data = word.strip().partition(".")
        try:
            # `encode` leaves out the padding, but `b64decode` demands it.
            text = base64.b64decode(data + "=" * (-len(data) % 4), altchars=b"-_", validate=True)
            token = _JSON.validate_json(text)
            bytes.fromhex(token.secret)
            split_address(token.endpoint)
            if f"{start}." != _START:
                raise ValueError(start)
        # Errors of base64 and pydantic are ValueErrors, too.
        except ValueError as error:
            raise ConfigError("this is no token of a run, or only a part of one", expected=f"{_START}...") from error
        return token

    def check_build(self) -> None:
        """Check that this machine would compute the same throws as the run's own machine."""
        if self.build != build_digest(*self.parts):
            raise ConfigError(
                f"run {self.run}: this machine has other sources, or another build or package of one of "
                f"{', '.join(filter(None, self.parts))}, and would collect other bytes",
                hint="install the same versions on both machines, or the image on both; throwcollect doctor shows the "
                "build of each",
            )


_JSON = TypeAdapter(JoinToken)


def join_run(
    word: str,
    simulations: int,
    *,
    reporter: Reporter = SILENT,
    interruptions: Callable[[], int] = lambda: 0,
) -> None:
    """Simulate trials of a run that another machine has begun, until the run is over; `word` is the token of the run.

    If the user asks to stop, which `interruptions` counts, simulations of other machines do the running trials again.
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
        reporter.say(f"run {token.run}: {format_count(simulations, 'simulation')} of this machine will join")
        record = RunRecord(token.run, scratch, scratch / "logs", simulations, Middleware(), key)
        _simulate(LocalNodes(record, config, elsewhere=token.endpoint), connection, config, reporter, interruptions)


def _simulate(
    host: LocalNodes, connection: Connection, config: Config, reporter: Reporter, interruptions: Callable[[], int]
) -> None:
    """Keep the simulations alive until the run is over."""
    from throwcollect.collect.runtimes.run_listener import RunListener

    heard_at, finished = time.monotonic(), False

    def update(progress: Progress) -> None:
        nonlocal heard_at, finished
        heard_at, finished = time.monotonic(), progress.steps[0] >= progress.steps[1]
        reporter.update(progress)

    # Names of nodes have to be unique, and several processes of one machine may join.
    name = name_simulation_on(f"{socket.gethostname()}_{os.getpid()}")
    roster = list_simulations([f"{name}_{index}" for index in range(host.record.simulations)], host.data)
    with Supervisor(host, config.run, roster) as supervisor, RunListener(update) as listener:
        supervisor.start()
        while not interruptions() and time.monotonic() <= heard_at + (_OVER_S if finished else _SILENT_S):
            listener.spin(connection, _POLL_S)
            # The first value is the end of the main node, which is on another machine.
            _, news = supervisor.poll()
            for line in news:
                reporter.warn(line)
    if interruptions():
        reporter.say("left; the run goes on without the simulations of this machine")
    elif finished:
        reporter.say("the run is over")
    else:
        message = f"no report of the run has arrived for {_SILENT_S:g} s"
        raise WorkerError(message, hint="join it again if it still goes on")


def _read_configuration(connection: Connection, token: JoinToken) -> tuple[str, str]:
    """Ask the launcher of the run for the configuration, and for the files of its robot."""
    connection.middleware.joining.settle()
    from throwcollect.collect.runtimes.run_listener import call_nodes
    from throwcollect.ros.srv import GetParameters

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
