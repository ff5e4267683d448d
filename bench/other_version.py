"""The version of another commit, measured by its own `bench.collection`, in turns with this one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from bench.collection import Collection

_ROOT = Path(__file__).parents[1]
_PROGRAM = """
import json, sys
from dataclasses import asdict
from pathlib import Path
from bench import collection
from throwcollect.config.loader import load
try:
    from bench.collection import draw_unchecked_plan
except ImportError:  # in commits whose benchmarks have no such function
    from throwcollect.plan.plan import make_plan as draw_unchecked_plan

config, overrides, simulations, directory = json.loads(sys.argv[1])
plan = draw_unchecked_plan(load(Path(config), overrides))
print(json.dumps(asdict(collection.measure(plan, simulations, Path(directory)))))
"""


class OtherVersion:
    """A commit of this repository, with the libraries of this environment.

    Args:
        revision: Any name that git knows the commit by.
        directory: Where its files are put.

    Raises:
        SystemExit: If git knows no such commit.
    """

    def __init__(self, revision: str, directory: Path) -> None:
        self._directory = directory
        directory.mkdir()
        archive = subprocess.run(
            ["git", "archive", revision, "src", "bench", "configs"], cwd=_ROOT, capture_output=True, check=False
        )
        if archive.returncode:
            sys.exit(f"{revision} is no commit that can be measured: {archive.stderr.decode().strip()}")
        subprocess.run(["tar", "-x"], cwd=directory, check=True, input=archive.stdout)

    def measure(self, config: Path, overrides: list[str], simulations: int, directory: Path) -> Collection:
        """Collect as `bench.collection.measure` does; the configuration is its own, at the same place in its files."""
        own = self._directory / config.relative_to(_ROOT)
        said = subprocess.run(
            [sys.executable, "-c", _PROGRAM, json.dumps([str(own), overrides, simulations, str(directory)])],
            cwd=self._directory,
            env={**os.environ, "PYTHONPATH": f"{self._directory / 'src'}{os.pathsep}{self._directory}"},
            check=True,
            stdout=subprocess.PIPE,
        )
        return Collection(**json.loads(said.stdout.splitlines()[-1]))
