"""A run that is ready to be launched: in this process, or in one of its own."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import cast

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.ros.endpoint import split_address
from throwcollect.runs.onlooker import Onlooker
from throwcollect.runs.record import Record, Summary
from throwcollect.runs.records import OpenRun, Records, Run
from throwcollect.runs.token import JoinToken
from throwcollect.runtimes.ports import format_endpoint, reach_from_elsewhere
from throwcollect.runtimes.runtime import Place, Runtime


class PreparedRun:
    """A run that is ready to be launched; use it as a context manager, so that nothing is left if it is not.

    Until it is launched, nobody else prepares a run into its directory.

    Attributes:
        records: All runs.
        config: Its configuration.
        directory: Directory of the dataset, as it was named; None if the dataset is in a volume.

    Args:
        records: All runs.
        run: The run, with a record.
        config: Its configuration.
        directory: Directory of the dataset, as it was named.
        onlooker: Is told what goes on.
        runtime: Its runtime, with what that has begun; None if it has begun nothing.
        held: Keeps others from the directory until the launcher, which may be another process, does so itself.
        undo: Removes what was made for the run, if it is not launched.
    """

    def __init__(
        self,
        records: Records,
        run: OpenRun,
        config: Config,
        directory: Path,
        *,
        onlooker: Onlooker,
        runtime: Runtime | None = None,
        held: ExitStack | None = None,
        undo: ExitStack | None = None,
    ) -> None:
        self.records = records
        self.config = config
        self.directory = None if run.record.volume else directory
        self._run = run
        self._onlooker = onlooker
        self._runtime = runtime
        self._held = held or ExitStack()
        self._undo = undo or ExitStack()

    def __enter__(self) -> PreparedRun:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._held:
            self._undo.close()
            self._run.close()

    @property
    def record(self) -> Record:
        """What is known of it."""
        return self._run.record

    @property
    def place(self) -> Place:
        """Where it lies."""
        return self._run.record.place(self._run.key)

    @property
    def token(self) -> str:
        """The word by which other machines join it; a secret, as whoever has it may do so.

        Raises:
            ConfigError: If it listens to this machine alone, or its key cannot be read.
        """
        from throwcollect.build import build_digest

        if self.config.run.listen is None:
            raise ConfigError("other machines cannot join the run", hint="run.listen says where they can")
        host, port = split_address(self.config.run.listen)
        endpoint = format_endpoint("tls", reach_from_elsewhere(host), port)
        run, secret, engine = self.record.run, self._run.key.secret.hex(), self.config.sim.engine
        domain_id = self.config.run.domain_id
        return JoinToken(run, endpoint, secret, domain_id, engine, build_digest(engine)).encode()

    def collect(self, *, interruptions: Callable[[], int] = lambda: 0) -> Summary:
        """Launch it in this process, and come back when it has ended; see `launcher.launch`.

        Args:
            interruptions: How often the user has asked to stop.

        Returns:
            What the dataset holds; its outcomes say whether trials are lost.

        Raises:
            ThrowcollectError: As `launcher.launch`.
        """
        # Nobody but `background` begins runs that collect nothing.
        return cast(Summary, self.launch(interruptions=interruptions))

    def launch(self, *, interruptions: Callable[[], int] = lambda: 0) -> Summary | None:
        """Launch it in this process, whatever it is for; see `collect`.

        Returns:
            What the dataset holds; None if the run collects nothing.

        Raises:
            ThrowcollectError: As `launcher.launch`.
        """
        from throwcollect.runs.launcher import launch

        self._undo.pop_all()
        return launch(
            self._run, self.config, onlooker=self._onlooker, interruptions=interruptions, runtime=self._runtime
        )

    def start(self, *, interruptions: Callable[[], int] = lambda: 0) -> Run:
        """Launch it in a process of its own, which outlives this one, and come back when its nodes are started.

        Args:
            interruptions: How often the user has asked to stop; the launcher is told then, and waited for.

        Raises:
            WorkerError: If it cannot be started.
            ThrowcollectError: What it ended with, if it did so already.
        """
        from throwcollect.runs.launcher import start_launcher, wait_for_nodes

        self._undo.pop_all()
        if self._runtime is not None:
            # What it has begun is of no use to another process.
            self._runtime.close()
        record = self._run.record
        process = start_launcher(self._run)
        wait_for_nodes(self.records, record, process, interruptions=interruptions)
        return self.records.get(record.run)
