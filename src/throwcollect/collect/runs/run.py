"""A run of this machine: its record, its key, and, in the process that prepares and launches it, its lock."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, Literal, cast

from pydantic import TypeAdapter, ValidationError

from throwcollect.collect.runtimes.node_logs import NodeLogs
from throwcollect.collect.runtimes.nodes import LAUNCHER
from throwcollect.collect.runtimes.run_record import NodeState, RunRecord
from throwcollect.collect.runtimes.runtime import find_runtime
from throwcollect.config.schema import Config
from throwcollect.dataset.summary import Info
from throwcollect.errors import ConfigError, ConflictError, NotFoundError, WorkerError
from throwcollect.files import beside, open_log, write_all
from throwcollect.own_process import count_interruptions, make_command, stop_signals
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router_endpoint import format_endpoint, reach_from_elsewhere, split_address
from throwcollect.run_key import RunKey
from throwcollect.state_directory import is_locked, unusable
from throwcollect.wording import command

Launch = Callable[["Run", Callable[[], int]], Info | None]
"""Launches a run in this process; the function that it gets counts how often the user has asked to stop."""
_ADAPTER = TypeAdapter(RunRecord)
_POLL_S = 0.05


class Run:
    """A run of this user on this machine.

    To most processes it is what its record had when it was read; `now` reads the record again. One that `prepare` or
    `resume` has returned has not begun: launch it once, by `collect` or `start`, and use it as a context manager, which
    removes its files if it is not launched. Until then, no other run can be prepared into its directory.

    Attributes:
        id: Its id.
        key: The key that the router asks for.
        lives: Whether its launcher lived when the record was read.
        directory: Directory of the dataset of a prepared run, as the user named it; None for other runs.
        files: Directory of the key, and of the files of a run without a dataset.
        lock: Descriptor of the locked file, which a process that takes the run over inherits; -1 in other processes.
    """

    def __init__(self, runs: Path, id: str, *, lock: int = -1) -> None:
        self.id = id
        self.directory: Path | None = None
        self.files = runs / id
        self.key = RunKey(self.files / "key")
        self.lock = lock
        self._path = runs / f"{id}.json"
        self._lock_path = runs / f"{id}.lock"
        # A launcher writes the end of the run before it releases the lock. So the lock is checked before the record is
        # read; otherwise a run that ends in between would look dead.
        self.lives = lock >= 0 or self.is_locked()
        self._record: RunRecord | None = None
        self._config: Config | None = None
        self._launch: Launch | None = None
        self._held = ExitStack()
        self._undo = ExitStack()

    @property
    def record(self) -> RunRecord:
        """The record of the run."""
        if self._record is None:
            self._record = self._read()
        return self._record

    def now(self) -> Run:
        """Read the run again."""
        run = Run(self._path.parent, self.id)
        run._record = run._read()
        return run

    def is_locked(self) -> bool:
        """Whether the launcher of the run lives now."""
        return is_locked(self._lock_path)

    @property
    def connection(self) -> Connection | None:
        """The way into the ROS graph of the run; None while it has no router."""
        record = self.record
        if record.endpoint is None:
            return None
        return Connection(record.endpoint, self.key, record.domain_id, record.middleware)

    @property
    def may_outlive_launcher(self) -> bool:
        """Whether nodes may go on without the launcher; true also if the runtime cannot be used here."""
        runtime = find_runtime(self.record.runtime) if self.record.runtime else None
        return self.record.runtime != "" and (runtime is None or runtime.outlives_launcher)

    @property
    def nodes(self) -> tuple[NodeState, ...]:
        """The nodes that can still run; none if the launcher died and they were its processes, as these end with it."""
        return self.record.nodes if self.status != "died" or self.may_outlive_launcher else ()

    @property
    def status(self) -> Literal["running", "ended", "abandoned", "died"]:
        """State of the run; ``abandoned``: it ended but left containers; ``died``: its launcher died before the end."""
        if self.record.ended is not None:
            return "abandoned" if self.record.left else "ended"
        return "running" if self.lives else "died"

    @property
    def config(self) -> Config:
        """The configuration of a run that was prepared in this process."""
        if self._config is None:
            raise ConflictError(f"run {self.id}: was not prepared in this process")
        return self._config

    @property
    def token(self) -> str:
        """The token with which simulations of other machines join the prepared run; keep it secret."""
        from throwcollect.collect.runs.joining import JoinToken

        if self.config.run.listen is None:
            raise ConfigError("other machines cannot join the run", hint="set run.listen to an address of this machine")
        host, port = split_address(self.config.run.listen)
        endpoint = format_endpoint("tls", reach_from_elsewhere(host), port)
        return JoinToken.of(self.id, endpoint, self.key, self.config).encode()

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        # The directory stays locked until the files that were made in it are removed.
        with self._held:
            self._undo.close()
            self.close()

    def collect(self, *, interruptions: Callable[[], int] = lambda: 0) -> Info:
        """Launch a prepared run in this process, and return when it has ended; see `launcher.launch`.

        `runs.stop` sends SIGTERM to the launcher of a run, which is this process. So that it does not end the program,
        this method counts SIGTERM as an interruption, if it is called in the main thread and the program has set no
        handler of its own.

        Returns:
            The summary of the dataset; its outcomes show whether trials are lost.
        """
        launch = self._take_launch()
        with count_interruptions(_find_fatal_signals()) as terminations:
            summary = launch(self, lambda: interruptions() + terminations())
        # Runs without a dataset have no summary. Only `background` prepares those, and it does not use the result.
        return cast(Info, summary)

    def start(self, *, interruptions: Callable[[], int] = lambda: 0) -> Run:
        """Launch a prepared run in a process of its own, which outlives this one; return when its nodes are started.

        If the user asks to stop, which `interruptions` counts, this method asks the launcher to stop, and waits for it.
        """
        self._take_launch()
        try:
            process = self.hand_over(self.record)
        except OSError as error:
            raise WorkerError(f"the launcher cannot be started: {error}") from error
        finally:
            self.close()
        forwarded = 0
        while (run := self.now()).status == "running":
            if interruptions() > forwarded:
                forwarded = interruptions()
                process.terminate()
            nodes = run.record.nodes
            # After a request to stop, this waits for the end even if all nodes start, to show how the run ended.
            if nodes and all(node.handle for node in nodes) and not forwarded:
                return run
            time.sleep(_POLL_S)
        if run.record.ended is not None:
            if (failure := run.record.error) is not None:
                raise failure
            return run
        evidence = NodeLogs(run.record.logs).tail(LAUNCHER)
        raise WorkerError(f"run {run.id}: its launcher died", evidence=evidence or None)

    def begin(self, name: str, directory: Path, **facts: Any) -> RunRecord:
        """Make the record of a run that this process launches; `facts` are further fields of it."""
        shown = Path(os.path.realpath(directory))
        return RunRecord(self.id, shown, self.files / "logs", 0, Middleware(), self.key, name=name, **facts)

    def prepared(self, config: Config, directory: Path, launch: Launch, *, held: ExitStack, undo: ExitStack) -> Run:
        """Make the run ready to be launched.

        Args:
            config: Its configuration.
            directory: Directory of the dataset, as the user named it.
            launch: Launches the run in this process.
            held: Holds the lock of the directory until the launcher, which may be another process, holds it itself.
            undo: Removes the files that were made for the run, if it is not launched.
        """
        self.directory = directory
        self._config, self._launch, self._held, self._undo = config, launch, held, undo
        return self

    def _take_launch(self) -> Launch:
        """Hand the prepared run over to its launcher, which writes its end and keeps its files."""
        if self._launch is None or self.lock < 0:
            raise ConflictError(f"run {self.id}: was launched already", expected="a run that is prepared, not launched")
        launch, self._launch = self._launch, None
        self._undo.pop_all()
        return launch

    def write(self, record: RunRecord) -> None:
        """Write the record, in the process that holds the lock."""
        self._record = record
        try:
            with beside(self._path, mode=0o600) as descriptor:
                write_all(descriptor, _ADAPTER.dump_json(record, indent=1))
        except OSError as error:
            raise unusable(self._path, error) from error

    def update(self, **changes: Any) -> None:
        """Change fields of the record, and write it if that makes a difference."""
        changed = replace(self.record, **changes)
        if changed != self.record:
            self.write(changed)

    def hand_over(self, record: RunRecord, order: bytes = b"") -> subprocess.Popen[bytes]:
        """Start a process that takes this run over, write the record with its id, and send it the order.

        The process calls `background.carry_out`, prints into the launcher's log, and has a session of its own, so that
        it outlives the terminal. It inherits the lock, which this process releases: otherwise the run would seem to
        outlive its launcher.
        """
        words = [*make_command(), "begin", self.id, "--lock", str(self.lock)]
        # The process needs a second until it can handle signals; a request to stop stays blocked until then.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, stop_signals())
        try:
            with open(open_log(NodeLogs(record.logs).path(LAUNCHER)), "ab") as log:
                process = subprocess.Popen(
                    words, stdin=subprocess.PIPE, stdout=log, stderr=log, start_new_session=True, pass_fds=[self.lock]
                )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        try:
            # The process waits for the order before it changes the record, so the record has to be written first.
            self.write(replace(record, launcher=process.pid))
            with cast(IO[bytes], process.stdin) as pipe:
                pipe.write(order)
        except BaseException:
            process.kill()
            process.wait()
            raise
        self.close()
        return process

    def close(self) -> None:
        """Release the lock of the run; the record stays."""
        if self.lock >= 0:
            os.close(self.lock)
            self.lock = -1

    def forget(self) -> None:
        """Remove the record and the files of the run, but no dataset in a directory, and release the lock."""
        # The record is removed first and the lock is released last: no process finds or takes a half-removed run.
        for path in (self._path, self._lock_path):
            with suppress(OSError):
                path.unlink()
        shutil.rmtree(self.files, ignore_errors=True)
        self.close()

    def _read(self) -> RunRecord:
        try:
            return _ADAPTER.validate_json(self._path.read_bytes())
        except FileNotFoundError as error:
            raise NotFoundError(f"no run {self.id}", hint="throwcollect ps -a lists all") from error
        except OSError as error:
            raise unusable(self._path, error) from error
        except ValidationError as error:
            hint = f"{command('down', '--run', self.id)} ends what is left of it, and forgets it"
            raise ConfigError(
                f"{self._path}: the record is damaged, or of another version of throwcollect", hint=hint
            ) from error


def _find_fatal_signals() -> tuple[signal.Signals, ...]:
    """Return SIGTERM if it would end this process and this thread may set a handler for it; nothing otherwise."""
    in_main_thread = threading.current_thread() is threading.main_thread()
    fatal = in_main_thread and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    return (signal.SIGTERM,) if fatal else ()
