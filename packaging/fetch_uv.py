"""Fetches uv from the Python package index with nothing but Python: `fetch_uv.py DIRECTORY` makes `DIRECTORY/bin/uv`.

For machines whose Python has neither pip nor ensurepip, as that of Debian and Ubuntu is without further packages.
"""

import hashlib
import io
import json
import platform
import re
import sys
import urllib.request
import zipfile
from pathlib import Path

INDEX = "https://pypi.org/simple/uv/"
TIMEOUT_S = 60


def get(url: str, accept: str = "*/*") -> bytes:
    """Bytes behind an address, which is the index's or one that it tells."""
    request = urllib.request.Request(url, headers={"Accept": accept})  # noqa: S310
    with urllib.request.urlopen(request, timeout=TIMEOUT_S) as answer:  # noqa: S310
        return answer.read()


def find_wheel(files: list, system: str, machine: str, musl: bool):
    """The newest wheel for this machine among the files of the index, without those of releases to come.

    Args:
        files: Files as the index describes them (PEP 691): `filename`, `url`, `hashes`, `yanked`.
        system: `platform.system()`.
        machine: `platform.machine()`.
        musl: Whether the C library is musl.

    Returns:
        One of `files`, or None.
    """
    kind = {"Linux": "musllinux" if musl else "manylinux", "Darwin": "macosx"}.get(system, "no wheel")
    fitting = []
    for file in files:
        found = re.match(r"uv-(\d+(?:\.\d+)*)-py3-none-(.*)\.whl$", file["filename"])
        if found and kind in found[2] and found[2].endswith("_" + machine) and not file.get("yanked"):
            fitting.append((tuple(map(int, found[1].split("."))), file["filename"], file))
    return max(fitting, key=lambda version_and_name: version_and_name[:2])[2] if fitting else None


def main() -> None:
    """Fetches, compares the digest, and unpacks the one program."""
    files = json.loads(get(INDEX, "application/vnd.pypi.simple.v1+json"))["files"]
    machine = platform.system(), platform.machine(), platform.libc_ver()[0] != "glibc"
    wheel = find_wheel(files, *machine)
    if wheel is None:
        sys.exit(f"the index has no uv for {machine[0]} on {machine[1]}")
    packed = get(wheel["url"])
    if hashlib.sha256(packed).hexdigest() != wheel["hashes"]["sha256"]:
        sys.exit(f"{wheel['url']}: what came is not what the index promises")
    program = Path(sys.argv[1], "bin", "uv")
    program.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".data/scripts/uv")]
        program.write_bytes(archive.read(name))
    program.chmod(0o755)


if __name__ == "__main__":
    main()
