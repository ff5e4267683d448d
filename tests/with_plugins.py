"""Runs modules of throwcollect where the robot, the task and the format of `tests/plugins` are installed."""

import os
import subprocess
import sys
from pathlib import Path

PLUGINS = Path(__file__).parent / "plugins"


def run_with_plugins(module: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a module in a process that finds these packages."""
    path = os.pathsep.join([str(PLUGINS), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-m", module, *arguments],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
