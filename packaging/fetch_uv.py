"""Fetches the uv of `uv.lock` with nothing but Python: `fetch_uv.py DIRECTORY` makes `DIRECTORY/bin/uv`.

The Python of Debian has neither pip nor ensurepip without further packages. A wheel that lies beside this script is
taken instead of that of the index.
"""

import hashlib
import io
import platform
import re
import sys
import urllib.request
import zipfile
from pathlib import Path

TIMEOUT_S = 60


def find_wheel(lock: str, system: str, machine: str, musl: bool):
    """Address and SHA-256 of the wheel for a machine; None if there is none.

    Args:
        lock: Text of `uv.lock`; it is no TOML here, because Python 3.10 cannot read that.
        system: `platform.system()`.
        machine: `platform.machine()`.
        musl: Whether the C library is musl.
    """
    kind = {"Linux": "musllinux" if musl else "manylinux", "Darwin": "macosx"}.get(system, "none")
    address = rf'"(https://[^"]*/uv-[\d.]+-py3-none-[^"]*{kind}[^"]*_{machine}\.whl)"'
    found = re.search(rf'{address}, hash = "sha256:(\w+)"', lock)
    return found and found.groups()


def main() -> None:
    """Fetches, compares the hash, and unpacks the one program."""
    here = Path(__file__).resolve().parent
    lock = next(place / "uv.lock" for place in (here, *here.parents) if (place / "uv.lock").exists())
    found = find_wheel(
        lock.read_text(encoding="utf-8"), platform.system(), platform.machine(), platform.libc_ver()[0] != "glibc"
    )
    if found is None:
        sys.exit(f"uv.lock has no uv for {platform.system()} on {platform.machine()}")
    beside = here / found[0].rpartition("/")[2]
    address = beside.as_uri() if beside.exists() else found[0]
    with urllib.request.urlopen(address, timeout=TIMEOUT_S) as answer:  # noqa: S310
        wheel = answer.read()
    if hashlib.sha256(wheel).hexdigest() != found[1]:
        sys.exit(f"{found[0]} is not the file that uv.lock pins")
    program = Path(sys.argv[1], "bin", "uv")
    program.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(io.BytesIO(wheel)) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".data/scripts/uv")]
        program.write_bytes(archive.read(name))
    program.chmod(0o755)


if __name__ == "__main__":
    main()
