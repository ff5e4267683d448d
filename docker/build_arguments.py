"""Prints the arguments of `docker build` and `apptainer build` that label an image with the sources it is made from.

By the labels, throwcollect notices an image of other sources. Runs on Python 3.10 and later, without throwcollect
installed.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))

from throwcollect.collect.runtimes.image_sources import UNKNOWN, digest_sources  # noqa: E402 - from this clone
from throwcollect.version import __version__  # noqa: E402


def find_revision() -> str:
    """Commit of the clone, with ``-dirty`` if tracked files differ from it."""
    # An unpacked archive may lie in a clone of something else.
    if not (ROOT / ".git").exists():
        return UNKNOWN
    command = ["git", "-C", str(ROOT), "describe", "--always", "--abbrev=40", "--exclude=*", "--dirty"]
    try:
        return subprocess.check_output(command, text=True, stderr=subprocess.DEVNULL).strip()
    except (OSError, subprocess.CalledProcessError):
        return UNKNOWN


def main() -> None:
    """Print the arguments in one line."""
    values = {"VERSION": __version__, "REVISION": find_revision(), "SOURCES": digest_sources(ROOT)}
    print(*(f"--build-arg {name}={value}" for name, value in values.items()))


if __name__ == "__main__":
    main()
