"""The command `throwcollect`, also `python -m throwcollect`: prepares the process, and then loads the libraries."""

from __future__ import annotations

import gc

from throwcollect.own_process import leave_when_stopped


def main() -> None:
    """Run the command line of this process and exit with its code."""
    # The handlers come before all other imports, which take a while: Ctrl-C during them would end in a traceback.
    leave_when_stopped()
    # Imports leave hardly any garbage, and looking for it as often as by default takes a twentieth of their time.
    gc.set_threshold(50_000)
    from throwcollect.cli.streams import open_streams
    from throwcollect.own_process import prepare_environment

    prepare_environment()
    open_streams()
    from throwcollect.cli.main import main as run_command

    run_command()


if __name__ == "__main__":
    main()
