"""Fills a directory with the wheels of which the image is built without network: `python3 wheelhouse.py DIR`.

Those that `uv.lock` pins, and what builds throwcollect itself. `--ros` adds genuine ROS 2, which
`packaging/ros_wheels.py` collects and builds. A directory that was filled from the same lists is left as it is. Runs on
Python 3.11, with pip and uv.
"""

from __future__ import annotations

import argparse
import hashlib
import platform
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import tomllib

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "packaging"))
import ros_wheels  # noqa: E402 - beside the image's own scripts, as `make ros` needs it too

ROS_WHEELS = ROOT / "build" / "wheelhouse-ros"
"""Where the wheels of ROS are kept; `make ros` has them there too."""
GLIBC_MINOR = 36
"""Version 2.36 of the C library is that of Debian bookworm."""
STAMP = "made-from.sha256"


def requirements() -> list[str]:
    """What nodes need at run time, what builds throwcollect, and uv, which installs both."""
    export = ["export", "--quiet", "--frozen", "--project", ROOT, "--no-emit-project", "--no-hashes", "--no-header"]
    extras = ["--extra=collect", "--extra=mujoco", "--no-annotate"]
    nodes = subprocess.check_output([sys.executable, "-m", "uv", *export, *extras], text=True).splitlines()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    lock = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))
    (uv,) = [package["version"] for package in lock["package"] if package["name"] == "uv"]
    return [*nodes, *project["build-system"]["requires"], f"uv=={uv}"]


def digest(*, ros: bool) -> str:
    """Hash over everything that determines what is in the wheelhouse.

    Args:
        ros: Whether ROS is in it.
    """
    more = [ros_wheels.digest()] if ros else []
    return hashlib.sha256("\0".join([Path(__file__).read_text(), *requirements(), *more]).encode()).hexdigest()


def collect(directory: Path, *, ros: bool) -> None:
    """Collect the wheels.

    Args:
        directory: Where they go.
        ros: Whether those of the extra `ros` are wanted, too.

    Raises:
        subprocess.CalledProcessError: If a wheel cannot be had or built; pip has said why.
    """
    # One waits for the network while the other compiles.
    with ThreadPoolExecutor(max_workers=1) as pool:
        filling = pool.submit(ros_wheels.fill, ROS_WHEELS) if ros else None
        download(directory)
        if filling:
            filling.result()
            shutil.copytree(ROS_WHEELS, directory, dirs_exist_ok=True, ignore=shutil.ignore_patterns("*.sha256"))


def download(directory: Path) -> None:
    """Download the wheels for the C library of the image, whatever that of this machine is.

    Args:
        directory: Where they go.

    Raises:
        subprocess.CalledProcessError: If a wheel cannot be had; pip has said which.
    """
    machine = platform.machine()
    platforms = [f"manylinux_2_{minor}_{machine}" for minor in range(GLIBC_MINOR, 4, -1)]
    platforms += [f"manylinux2014_{machine}", f"manylinux2010_{machine}", f"manylinux1_{machine}"]
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"]
    command += ["--only-binary=:all:", "--dest", str(directory)]
    subprocess.run([*command, *(f"--platform={name}" for name in platforms), *requirements()], check=True)


def main(directory: Path, *, ros: bool = False) -> None:
    """Fill a directory, unless it is up to date.

    Args:
        directory: The wheelhouse; everything in it is replaced.
        ros: Whether genuine ROS 2 is wanted too.

    Raises:
        subprocess.CalledProcessError: If a wheel cannot be downloaded.
    """
    stamp = directory / STAMP
    if stamp.is_file() and stamp.read_text(encoding="ascii") == digest(ros=ros):
        print(f"{directory}: up to date")
        return
    if directory.exists() and (
        foreign := [path for path in directory.iterdir() if path.suffix not in (".whl", ".sha256")]
    ):
        sys.exit(f"{directory}: holds {foreign[0].name}, which is no wheel; name a new or empty directory")
    shutil.rmtree(directory, ignore_errors=True)
    directory.mkdir(parents=True)
    collect(directory, ros=ros)
    stamp.write_text(digest(ros=ros), encoding="ascii")
    wheels = list(directory.glob("*.whl"))
    print(f"{directory}: {len(wheels)} wheels, {sum(path.stat().st_size for path in wheels) / 1e6:.0f} MB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition(":")[0])
    parser.add_argument("--ros", action="store_true", help="add genuine ROS 2")
    parser.add_argument("directory", type=Path)
    arguments = parser.parse_args()
    main(arguments.directory, ros=arguments.ros)
