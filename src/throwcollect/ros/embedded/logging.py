"""Logging: one line a message to standard error and, for nodes, to ``/rosout``."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from throwcollect.ros.embedded.duration import S_TO_NS


class LoggingSeverity(IntEnum):
    """How severe a message is; the values are those of rcl_interfaces/msg/Log."""

    UNSET = 0
    DEBUG = 10
    INFO = 20
    WARN = 30
    ERROR = 40
    FATAL = 50


@dataclass(frozen=True)
class LogRecord:
    """One message of a logger.

    Attributes:
        severity: How severe it is.
        name: Name of the logger.
        text: The message.
        stamp_ns: System time [ns].
        file: Absolute path of the source that logged it.
        function: Function that logged it.
        line: Line in the source.
    """

    severity: LoggingSeverity
    name: str
    text: str
    stamp_ns: int
    file: str
    function: str
    line: int


Sink = Callable[[LogRecord], None]
"""Takes what is logged."""

_levels: dict[str, LoggingSeverity] = {"": LoggingSeverity.INFO}
_writing = threading.Lock()


class Logger:
    """Logs under a name. Levels belong to names, with dots between ancestors, and are inherited.

    Args:
        name: Name of the logger.
        sink: Gets what is logged besides standard error; None for nothing.
    """

    def __init__(self, name: str, sink: Sink | None = None) -> None:
        self.name = name
        self._sink = sink
        self._seen: dict[str, float] = {}

    def get_child(self, name: str) -> Logger:
        """Logger below this one."""
        return Logger(f"{self.name}.{name}", self._sink)

    def set_level(self, level: LoggingSeverity) -> None:
        """Set the least severity that is logged under this name."""
        _levels[self.name] = LoggingSeverity(level)

    def get_effective_level(self) -> LoggingSeverity:
        """Least severity that is logged: the one set for this name or its nearest ancestor."""
        name = self.name
        while name not in _levels:
            name = name.rpartition(".")[0]
        return _levels[name]

    def is_enabled_for(self, severity: LoggingSeverity) -> bool:
        """Whether messages of a severity are logged."""
        return severity >= self.get_effective_level()

    def log(
        self,
        message: object,
        severity: LoggingSeverity,
        *,
        once: bool = False,
        throttle_duration_sec: float | None = None,
    ) -> bool:
        """Log a message.

        Args:
            message: What to log.
            severity: How severe it is.
            once: Log this text the first time only.
            throttle_duration_sec: Log this text at most once in so many seconds.

        Returns:
            Whether it was logged.
        """
        if not self.is_enabled_for(severity):
            return False
        text = str(message)
        if once or throttle_duration_sec is not None:
            now, last = time.monotonic(), self._seen.get(text)
            if last is not None and (once or now - last < (throttle_duration_sec or 0.0)):
                return False
            self._seen[text] = now
        stamp = time.time_ns()
        line = f"[{severity.name}] [{stamp // S_TO_NS}.{stamp % S_TO_NS:09d}] [{self.name}]: {text}\n"
        with _writing:
            sys.stderr.write(line)
            sys.stderr.flush()
        if self._sink is not None:
            caller = sys._getframe(1)
            while caller.f_back is not None and caller.f_code.co_filename == __file__:
                caller = caller.f_back
            code = caller.f_code
            file = os.path.abspath(code.co_filename)
            self._sink(LogRecord(severity, self.name, text, stamp, file, code.co_name, caller.f_lineno))
        return True

    def debug(self, message: object, *, once: bool = False, throttle_duration_sec: float | None = None) -> bool:
        """Log with severity DEBUG; see `log`."""
        return self.log(message, LoggingSeverity.DEBUG, once=once, throttle_duration_sec=throttle_duration_sec)

    def info(self, message: object, *, once: bool = False, throttle_duration_sec: float | None = None) -> bool:
        """Log with severity INFO; see `log`."""
        return self.log(message, LoggingSeverity.INFO, once=once, throttle_duration_sec=throttle_duration_sec)

    def warning(self, message: object, *, once: bool = False, throttle_duration_sec: float | None = None) -> bool:
        """Log with severity WARN; see `log`."""
        return self.log(message, LoggingSeverity.WARN, once=once, throttle_duration_sec=throttle_duration_sec)

    warn = warning

    def error(self, message: object, *, once: bool = False, throttle_duration_sec: float | None = None) -> bool:
        """Log with severity ERROR; see `log`."""
        return self.log(message, LoggingSeverity.ERROR, once=once, throttle_duration_sec=throttle_duration_sec)

    def fatal(self, message: object, *, once: bool = False, throttle_duration_sec: float | None = None) -> bool:
        """Log with severity FATAL; see `log`."""
        return self.log(message, LoggingSeverity.FATAL, once=once, throttle_duration_sec=throttle_duration_sec)


def get_logger(name: str) -> Logger:
    """Logger that writes to standard error."""
    return Logger(name)
