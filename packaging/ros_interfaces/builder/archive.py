"""Writes the wheel and the source archive: sorted, with the time stamps that ``SOURCE_DATE_EPOCH`` says."""

from __future__ import annotations

import gzip
import io
import os
import shutil
import tarfile
from pathlib import Path

from builder.project import PROJECT, ROOT, license_files

TAG = "cp311-cp311-linux_x86_64"


def write_metadata(directory: Path) -> Path:
    """Write the ``.dist-info`` directory of the wheel, but for the list of its files.

    Args:
        directory: Where it goes.

    Returns:
        The directory.
    """
    target = directory / f"{PROJECT.stem}.dist-info"
    (target / "licenses").mkdir(parents=True)
    for path in license_files():
        shutil.copyfile(path, target / "licenses" / path.name)
    (target / "METADATA").write_text(_metadata(), encoding="utf-8")
    wheel = ["Wheel-Version: 1.0", "Generator: throwcollect-ros-interfaces", "Root-Is-Purelib: false", f"Tag: {TAG}"]
    (target / "WHEEL").write_text("\n".join([*wheel, ""]), encoding="utf-8")
    return target


def write_wheel(tree: Path, directory: Path) -> Path:
    """Pack a wheel.

    Args:
        tree: Its files, without metadata; these are added.
        directory: Where the wheel goes.

    Returns:
        The wheel.
    """
    from wheel.wheelfile import WheelFile

    write_metadata(tree)
    for path in tree.rglob("*"):
        # A wheel keeps modes, which are as the user's mask says.
        path.chmod(0o755 if path.is_dir() or ".so" in path.name else 0o644)
    target = directory / f"{PROJECT.stem}-{TAG}.whl"
    with WheelFile(str(target), "w") as wheel:
        wheel.write_files(str(tree))
    return target


def write_sdist(directory: Path) -> Path:
    """Pack the source archive.

    Args:
        directory: Where it goes.

    Returns:
        The archive.
    """
    epoch = int(os.environ["SOURCE_DATE_EPOCH"])
    files = {path.name: path for path in (ROOT / "pyproject.toml", ROOT / "README.md", *license_files())}
    files |= {f"builder/{path.name}": path for path in (ROOT / "builder").glob("*.py")}
    for package in PROJECT.packages:
        files |= {f"definitions/{package.name}/{file.as_posix()}": package.directory / file for file in package.files}
    contents = {name: path.read_bytes() for name, path in files.items()}
    contents["PKG-INFO"] = _metadata().encode()
    target = directory / f"{PROJECT.stem}.tar.gz"
    with (
        target.open("wb") as file,
        gzip.GzipFile("", "wb", fileobj=file, mtime=epoch) as packed,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive,
    ):
        for name, content in sorted(contents.items()):
            entry = tarfile.TarInfo(f"{PROJECT.stem}/{name}")
            entry.size, entry.mtime = len(content), epoch
            archive.addfile(entry, io.BytesIO(content))
    return target


def _metadata() -> str:
    headers = [
        "Metadata-Version: 2.4",
        f"Name: {PROJECT.name}",
        f"Version: {PROJECT.version}",
        f"Summary: {PROJECT.description}",
        "License-Expression: Apache-2.0 AND BSD-3-Clause",
        *(f"License-File: {path.name}" for path in license_files()),
        f"Requires-Python: {PROJECT.requires_python}",
        *(f"Requires-Dist: {requirement}" for requirement in PROJECT.dependencies),
        "Description-Content-Type: text/markdown",
    ]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    return "\n".join([*headers, "", readme])
