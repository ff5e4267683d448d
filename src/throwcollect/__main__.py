"""The command `throwcollect`, also `python -m throwcollect`: what has to hold before its libraries are loaded."""

from __future__ import annotations

import os
import signal
from types import FrameType
from typing import NoReturn

from throwcollect.interruption import stop_signals


def main() -> None:
    """Run the command line of this process and exit with its code."""
    for number in stop_signals():
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)
    from throwcollect.cli.streams import open_streams
    from throwcollect.own_process import claim_process

    claim_process()
    open_streams()
    from throwcollect.cli.main import main as run_command

    run_command()


def _leave(_number: int, _frame: FrameType | None) -> NoReturn:
    """End at once: where nothing has begun there is nothing to end in order, and libraries would not do so."""
    os._exit(130)


if __name__ == "__main__":
    main()
