"""Fills a directory with everything that pip needs to build the image without network: `python3 wheelhouse.py DIR`.

`--ros` adds genuine ROS 2: the wheels of the extra `ros`, which `packaging/ros_wheels.py` collects and builds.
Wheels of the dependencies in `pyproject.toml`, slimmed as the image will be, and of what builds throwcollect itself. A
directory that was filled for the same dependencies by the same rules is left as it is. Runs on Python 3.11 and later,
with pip.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import tomllib
from elf import is_elf, strip
from slim import find_repeated, find_unreached, is_kept

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "packaging"))
import ros_wheels  # noqa: E402 - beside the image's own scripts, as `make ros` needs it too

ROS_WHEELS = ROOT / "build" / "wheelhouse-ros"
"""Where the wheels of ROS are kept as they are; `make ros` has them there too."""
PYTHON = "3.11"
"""Version in the image; pybullet has no wheels for later ones."""
GLIBC_MINOR = 36
"""Version 2.36 of the C library is that of Debian bookworm."""
STAMP = "made-from.sha256"
_EPOCH = (1980, 1, 1, 0, 0, 0)


def requirements() -> list[str]:
    """What nodes need at run time and throwcollect to be built, and pip, as it may be missing in the base image."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = project["project"]["optional-dependencies"]
    nodes = [*project["project"]["dependencies"], *extras["collect"], *extras["mujoco"]]
    # pip would compare markers with the Python that runs here, and not with the image's.
    nodes = list(dict.fromkeys(requirement.partition(";")[0] for requirement in nodes))
    return [*nodes, *project["build-system"]["requires"], "pip"]


def digest(*, ros: bool) -> str:
    """Hash over everything that determines what is in the wheelhouse.

    Args:
        ros: Whether ROS is in it.
    """
    scripts = [(Path(__file__).parent / name).read_bytes() for name in ("elf.py", "slim.py", "wheelhouse.py")]
    more = [ros_wheels.digest().encode()] if ros else []
    return hashlib.sha256(b"\0".join([*scripts, "\n".join(requirements()).encode(), *more])).hexdigest()


def collect(directory: Path, *, ros: bool) -> None:
    """Collect the wheels as they are.

    Args:
        directory: Where they go.
        ros: Whether those of the extra `ros` are wanted, too; what is there in some version stays in that one.

    Raises:
        subprocess.CalledProcessError: If a wheel cannot be had or built; pip has said why.
    """
    if not ros:
        download(directory)
        return
    # One waits for the network while the other compiles.
    with ThreadPoolExecutor(max_workers=1) as pool:
        filling = pool.submit(ros_wheels.fill, ROS_WHEELS)
        download(directory)
        filling.result()
    there = {path.name.partition("-")[0].lower() for path in directory.glob("*.whl")}
    for wheel in ROS_WHEELS.glob("*.whl"):
        if wheel.name.partition("-")[0].lower() not in there:
            shutil.copyfile(wheel, directory / wheel.name)


def download(directory: Path) -> None:
    """Download the wheels for the image's Python and C library, whatever those of this machine are.

    Args:
        directory: Where they go.

    Raises:
        subprocess.CalledProcessError: If a wheel cannot be had; pip has said which.
    """
    machine = platform.machine()
    platforms = [f"manylinux_2_{minor}_{machine}" for minor in range(GLIBC_MINOR, 4, -1)]
    platforms += [f"manylinux2014_{machine}", f"manylinux2010_{machine}", f"manylinux1_{machine}"]
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"]
    command += ["--only-binary=:all:", f"--python-version={PYTHON}", "--implementation=cp", "--dest", str(directory)]
    subprocess.run([*command, *(f"--platform={name}" for name in platforms), *requirements()], check=True)


def repack(wheels: list[Path], directory: Path) -> None:
    """Write wheels anew without what `slim` takes out.

    Args:
        wheels: All wheels, as libraries in one are loaded by modules in another.
        directory: Where the new ones go, under the same names.
    """
    archives = {wheel: zipfile.ZipFile(wheel) for wheel in wheels}
    files: dict[str, Callable[[], bytes]] = {
        name: partial(archive.read, name)
        for archive in archives.values()
        for name in archive.namelist()
        if is_kept(name)
    }
    superfluous = find_unreached(files) | find_repeated(files)
    for wheel, archive in archives.items():
        names = [name for name in archive.namelist() if name in files and name not in superfluous]
        _write_wheel(directory / wheel.name, archive, [name for name in names if not name.endswith("/")])
        archive.close()


def _write_wheel(target: Path, archive: zipfile.ZipFile, names: list[str]) -> None:
    # Setuptools carries such lists of other packages further down.
    record = next(name for name in archive.namelist() if name.endswith(".dist-info/RECORD") and name.count("/") == 1)
    rows = []
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as slimmed:
        for name in names:
            content = archive.read(name)
            if ".so" in name and is_elf(content):
                content = strip(content)
            hashed = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            rows.append(f"{name},sha256={hashed},{len(content)}\n")
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.external_attr = archive.getinfo(name).external_attr
            entry.compress_type = zipfile.ZIP_DEFLATED
            # A quarter of the time that the usual compression takes, for a seventh more bytes.
            slimmed.writestr(entry, content, compresslevel=1)
        slimmed.writestr(zipfile.ZipInfo(record, _EPOCH), "".join([*rows, f"{record},,\n"]))


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
    with tempfile.TemporaryDirectory() as downloads:
        collect(Path(downloads), ros=ros)
        wheels = sorted(Path(downloads).glob("*.whl"))
        shutil.rmtree(directory, ignore_errors=True)
        directory.mkdir(parents=True)
        repack(wheels, directory)
        before, after = (
            sum(path.stat().st_size for path in place.glob("*.whl")) for place in (Path(downloads), directory)
        )
    stamp.write_text(digest(ros=ros), encoding="ascii")
    print(f"{directory}: {len(wheels)} wheels, {after / 1e6:.0f} MB ({before / 1e6:.0f} MB before slimming)")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition(":")[0])
    parser.add_argument("--ros", action="store_true", help="add genuine ROS 2")
    parser.add_argument("directory", type=Path)
    arguments = parser.parse_args()
    main(arguments.directory, ros=arguments.ros)
