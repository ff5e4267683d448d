"""A run that is ready to be launched, in this process or in one of its own."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import cast

from throwcollect.config.schema import Config
from throwcollect.coordinator.onlooker import Onlooker
from throwcollect.errors import ConfigError, ConflictError
from throwcollect.interruption import count_interruptions
from throwcollect.ros.router_endpoint import format_endpoint, reach_from_elsewhere, split_address
from throwcollect.runs.records import OpenRun, Records, Run
from throwcollect.runs.run_record import RunRecord, Summary
from throwcollect.runs.token import JoinToken
from throwcollect.runtimes.runtime import Place


class PreparedRun:
    """A run that is ready to be launched; use it as a context manager, which removes its files if it is not launched.

    Until it is launched, nobody else can prepare a run into its directory. It can be launched once.

    Attributes:
        directory: Directory of the dataset, as the user named it; None if the dataset is in a volume.

    Args:
        held: Holds the lock of the directory until the launcher, which may be another process, holds it itself.
        undo: Removes the files that were made for the run, if it is not launched.
    """

    def __init__(
        self,
        records: Records,
        run: OpenRun,
        config: Config,
        directory: Path,
        *,
        onlooker: Onlooker,
        held: ExitStack | None = None,
        undo: ExitStack | None = None,
    ) -> None:
        self.config = config
        self.directory = None if run.record.volume else directory
        self._records = records
        self._run = run
        self._onlooker = onlooker
        self._held = held or ExitStack()
        self._undo = undo or ExitStack()
        self._fate: str | None = None
        """What became of the run, as the words of the error if somebody launches it afterwards."""

    def __enter__(self) -> PreparedRun:
        return self

    def __exit__(self, *_: object) -> None:
        if self._fate is None:
            self._fate = "was given up when its block was left"
        # The directory stays locked until the files that were made in it are removed.
        with self._held:
            self._undo.close()
            self._run.close()

    @property
    def record(self) -> RunRecord:
        """The record of the run."""
        return self._run.record

    @property
    def place(self) -> Place:
        """The place of the run."""
        return self._run.place

    @property
    def token(self) -> str:
        """The token with which simulations of other machines join the run; keep it secret."""
        from throwcollect.trial.conditions import build_of

        if self.config.run.listen is None:
            raise ConfigError("other machines cannot join the run", hint="run.listen says where they can")
        host, port = split_address(self.config.run.listen)
        endpoint = format_endpoint("tls", reach_from_elsewhere(host), port)
        config = self.config
        return JoinToken(
            self.record.run,
            endpoint,
            self._run.key.secret.hex(),
            config.run.domain_id,
            config.sim.engine,
            build_of(config),
            config.robot.name,
            config.tool.name,
            config.task.name,
            config.task.policy.use if config.task.policy else "",
        ).encode()

    def collect(self, *, interruptions: Callable[[], int] = lambda: 0) -> Summary:
        """Launch the run in this process, and return when it has ended; see `launcher.launch`.

        `runs.stop` sends SIGTERM to the launcher of a run, which is this process. So that it does not end the program,
        this method counts SIGTERM as an interruption, if it is called in the main thread and the program has set no
        handler of its own.

        Returns:
            The summary of the dataset; its outcomes tell whether trials are lost.
        """
        from throwcollect.runs.launcher import launch

        self._hand_over()
        with count_interruptions(_find_fatal_signals()) as terminations:
            summary = launch(
                self._run,
                self.config,
                onlooker=self._onlooker,
                interruptions=lambda: interruptions() + terminations(),
            )
        # Runs without a dataset have no summary. Only `background` prepares those, and it does not use the result.
        return cast(Summary, summary)

    def start(self, *, interruptions: Callable[[], int] = lambda: 0) -> Run:
        """Launch the run in a process of its own, which outlives this one, and return when its nodes are started.

        If the user asks to stop, which `interruptions` counts, this method asks the launcher to stop, and waits for it.
        """
        from throwcollect.runs.launcher import start_launcher

        self._hand_over()
        return start_launcher(self._records, self._run, interruptions=interruptions)

    def _hand_over(self) -> None:
        """Hand the run over to its launcher, which writes its end; from then on, this object removes no files."""
        if self._fate is not None:
            raise ConflictError(
                f"run {self._run.run}: {self._fate}", expected="a run that is prepared and not launched"
            )
        self._fate = "was launched already"
        self._undo.pop_all()


def _find_fatal_signals() -> tuple[signal.Signals, ...]:
    """Return SIGTERM if it would end this process and this thread may set a handler for it; nothing otherwise."""
    in_main_thread = threading.current_thread() is threading.main_thread()
    fatal = in_main_thread and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    return (signal.SIGTERM,) if fatal else ()
