"""Logging: each message is a line on standard error and, if a node logs, a message on ``/rosout``."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from enum import IntEnum

from rclzenoh.interfaces.msg import Log
from rclzenoh.time import S_TO_NS, Time


class LoggingSeverity(IntEnum):
    """How severe a message is; the values are those of rcl_interfaces/msg/Log."""

    INFO = 20
    WARN = 30
    ERROR = 40


class Logger:
    """Logs under a name.

    Attributes:
        name: Name of the logger.
        sink: Gets each message after it was written to standard error; None if there is none.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.sink: Callable[[Log], None] | None = None
        self._seen: dict[str, float] = {}

    def log(
        self,
        message: object,
        severity: LoggingSeverity,
        *,
        throttle_duration_sec: float | None = None,
    ) -> bool:
        """Log a message, the same text at most once in ``throttle_duration_sec``; returns whether it was logged."""
        text = str(message)
        if throttle_duration_sec is not None:
            now, last = time.monotonic(), self._seen.get(text)
            if last is not None and now - last < throttle_duration_sec:
                return False
            self._seen[text] = now
        # The caller is the first frame outside of this module; frames of `info` and similar methods are skipped.
        caller = sys._getframe(1)
        while caller.f_back is not None and caller.f_code.co_filename == __file__:
            caller = caller.f_back
        code = caller.f_code
        return self.log_from((os.path.abspath(code.co_filename), code.co_name, caller.f_lineno), text, severity)

    def log_from(self, place: tuple[str, str, int], text: str, severity: LoggingSeverity) -> bool:
        """Log a message that comes from another place than the caller: absolute path of the source, function, line."""
        stamp = time.time_ns()
        line = f"[{severity.name}] [{stamp // S_TO_NS}.{stamp % S_TO_NS:09d}] [{self.name}]: {text}\n"
        # One call writes the whole line, also while other threads log.
        sys.stderr.write(line)
        sys.stderr.flush()
        if self.sink is not None:
            file, function, number = place
            self.sink(
                Log(
                    stamp=Time(nanoseconds=stamp).to_msg(),
                    level=int(severity),
                    name=self.name,
                    msg=text,
                    file=file,
                    function=function,
                    line=number,
                )
            )
        return True

    def info(self, message: object, *, throttle_duration_sec: float | None = None) -> bool:
        """Log with severity INFO; see `log`."""
        return self.log(message, LoggingSeverity.INFO, throttle_duration_sec=throttle_duration_sec)

    def warning(self, message: object, *, throttle_duration_sec: float | None = None) -> bool:
        """Log with severity WARN; see `log`."""
        return self.log(message, LoggingSeverity.WARN, throttle_duration_sec=throttle_duration_sec)

    def error(self, message: object, *, throttle_duration_sec: float | None = None) -> bool:
        """Log with severity ERROR; see `log`."""
        return self.log(message, LoggingSeverity.ERROR, throttle_duration_sec=throttle_duration_sec)
