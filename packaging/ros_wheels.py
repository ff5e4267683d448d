"""Fills a directory with the wheels of the extra `ros` and what they need: `python3.11 packaging/ros_wheels.py DIR`.

Those of ROS 2 come from the package index, in the versions that `ros_constraints.txt` says; the one of interfaces is
built from this clone. A directory that was filled from the same files is left as it is. With `--no-index
--find-links DIR`, pip needs no index for them.
"""

from __future__ import annotations

import argparse
import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import tomllib

ROOT = Path(__file__).resolve().parents[1]
INTERFACES = ROOT / "packaging" / "ros_interfaces"
CONSTRAINTS = ROOT / "packaging" / "ros_constraints.txt"
DEFINITIONS = ROOT / "src" / "rclzenoh" / "interfaces" / "definitions"
STAMP = "made-from.sha256"


def requirements() -> list[str]:
    """What the extra `ros` asks for, without the interfaces, which no index has."""
    document = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extra = document["project"]["optional-dependencies"]["ros"]
    return [requirement for requirement in extra if not requirement.startswith("throwcollect-ros-interfaces")]


def digest() -> str:
    """Hash over everything that determines which wheels there are and what the built one holds."""
    total = hashlib.sha256("\n".join(requirements()).encode())
    sources = [CONSTRAINTS, Path(__file__), *DEFINITIONS.rglob("*.*")]
    sources += [path for path in INTERFACES.rglob("*") if path.suffix in (".py", ".toml", ".md", ".BSD")]
    for path in sorted(path.resolve() for path in sources):
        total.update(f"{path.relative_to(ROOT)}\0".encode() + path.read_bytes() + b"\0")
    return total.hexdigest()


def fill(directory: Path) -> bool:
    """Fill a directory, unless it is up to date.

    Two processes may ask for the same directory at the same time, as the tests with ROS and the image do in continuous
    integration: the second one waits, and finds the directory up to date.

    Args:
        directory: Where the wheels go; those in it are replaced.

    Returns:
        Whether there was anything to do.

    Raises:
        subprocess.CalledProcessError: If wheels cannot be had or built; pip has said why.
    """
    directory.parent.mkdir(parents=True, exist_ok=True)
    with directory.with_name(f"{directory.name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        stamp = directory / STAMP
        if stamp.is_file() and stamp.read_text(encoding="ascii") == digest():
            return False
        shutil.rmtree(directory, ignore_errors=True)
        _collect(directory)
        stamp.write_text(digest(), encoding="ascii")
        return True


def _collect(directory: Path) -> None:
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check"]
    # By variables, as options would not reach what builds. The constraints as an address, as there may be several
    # files, with blanks between. PEP 517, as pip 23.0, that of Debian 12, otherwise needs `wheel`, which is missing.
    environment = {**os.environ, "PIP_CONSTRAINT": CONSTRAINTS.as_uri(), "PIP_USE_PEP517": "1"}
    subprocess.run(
        [*command, f"--wheel-dir={directory}", str(INTERFACES), *requirements()], env=environment, check=True
    )


def main(directory: Path) -> None:
    """Fill a directory and say what is in it, or end with what pip ended with; pip has said why.

    Args:
        directory: Where the wheels go.
    """
    try:
        is_new = fill(directory)
    except subprocess.CalledProcessError as error:
        sys.exit(error.returncode)
    wheels = list(directory.glob("*.whl"))
    size = sum(path.stat().st_size for path in wheels) / 1e6
    print(f"{directory}: {f'{len(wheels)} wheels, {size:.0f} MB' if is_new else 'up to date'}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description="Fills a directory with the wheels of genuine ROS 2, for pip without an index."
    )
    parser.add_argument("directory", type=Path)
    main(parser.parse_args().directory)
