"""Installs packages of npm for tests, each once on a machine."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

_BUILD = Path(__file__).parents[1] / "build"


def install(name: str, packages: Mapping[str, str]) -> Path:
    """Directory in whose ``node_modules`` packages lie; the test is skipped where they cannot be had.

    Args:
        name: What the directory is called.
        packages: Their versions by their names.
    """
    words = [f"{package}@{version}" for package, version in packages.items()]
    place = _BUILD / "-".join([name, *packages.values()])
    if shutil.which("npm") is None:
        pytest.skip("there is no npm")
    if not place.is_dir():
        _BUILD.mkdir(exist_ok=True)
        # The directory gets its name when it is whole, as several processes of the tests may install at the same time.
        with TemporaryDirectory(dir=_BUILD, ignore_cleanup_errors=True) as beside:
            command = ["npm", "install", "--no-audit", "--no-fund", "--prefix", beside, *words]
            found = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
            if found.returncode:
                pytest.skip(f"{name} cannot be installed: {found.stderr.strip().splitlines()[-1:]}")
            # Another process may have been faster, and then its directory stays.
            with suppress(OSError):
                Path(beside).rename(place)
    return place
