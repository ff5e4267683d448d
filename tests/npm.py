"""Packages of npm that tests need: each is installed once on a machine."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

_BUILD = Path(__file__).parents[1] / "build"


def install(name: str, version: str) -> Path:
    """Directory in whose ``node_modules`` a package lies; the test is skipped where it cannot be had."""
    place = _BUILD / f"{name}-{version}"
    if shutil.which("npm") is None:
        pytest.skip("there is no npm")
    if not (place / "node_modules" / name).is_dir():
        place.mkdir(parents=True, exist_ok=True)
        command = ["npm", "install", "--no-audit", "--no-fund", "--prefix", str(place), f"{name}@{version}"]
        found = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
        if found.returncode:
            pytest.skip(f"{name} cannot be installed: {found.stderr.strip().splitlines()[-1:]}")
    return place
