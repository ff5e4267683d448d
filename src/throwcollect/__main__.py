"""The command `throwcollect`, also `python -m throwcollect`: prepares the process, and then loads the libraries."""

from __future__ import annotations

import os
import signal
from types import FrameType
from typing import NoReturn

from throwcollect.interruption import stop_signals


def main() -> None:
    """Run the command line of this process and exit with its code."""
    # The handlers come before all other imports: these take a while, and Ctrl-C within them would end in a traceback.
    for number in stop_signals():
        # What is ignored stays ignored: scripts start commands with `&` so that Ctrl-C does not end them, for example.
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)
    from throwcollect.cli.streams import open_streams
    from throwcollect.own_process import claim_process

    claim_process()
    open_streams()
    from throwcollect.cli.main import main as run_command

    run_command()


def _leave(_number: int, _frame: FrameType | None) -> NoReturn:
    """End at once: nothing has begun that has to end in order, and a library that loads may ignore exceptions."""
    os._exit(130)


if __name__ == "__main__":
    main()
