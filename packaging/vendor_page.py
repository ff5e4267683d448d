"""Fetches the libraries of the page from npm, and notes what they are to be.

`python packaging/vendor_page.py` writes `src/throwcollect/serve/page/vendor` anew. Browsers find modules by path alone
where no inline script may map names to paths, so names are replaced by paths; nothing else is changed. The package of
urdf-loader lacks its licence, which is Apache-2.0 by its README: `LICENSE` there is that text.
"""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import tarfile
import tempfile
from pathlib import Path

VENDOR = Path(__file__).parents[1] / "src" / "throwcollect" / "serve" / "page" / "vendor"
SUMS = "SHA256SUMS"

_JSM = "examples/jsm/"
_FILES = {
    "three@0.187.0": (
        "LICENSE",
        "build/three.core.js",
        "build/three.module.js",
        f"{_JSM}controls/OrbitControls.js",
        f"{_JSM}loaders/ColladaLoader.js",
        f"{_JSM}loaders/collada/ColladaComposer.js",
        f"{_JSM}loaders/collada/ColladaParser.js",
        f"{_JSM}loaders/OBJLoader.js",
        f"{_JSM}loaders/STLLoader.js",
        f"{_JSM}loaders/TGALoader.js",
    ),
    "urdf-loader@0.13.1": ("README.md", "package.json", "src/URDFClasses.js", "src/URDFLoader.js"),
    "uplot@1.6.32": ("LICENSE", "dist/uPlot.esm.js", "dist/uPlot.min.css"),
}
"""What is taken of each package."""


def main() -> None:
    """Fetch all of it, and write the sums."""
    with tempfile.TemporaryDirectory() as directory:
        for package, files in _FILES.items():
            _pack(package, Path(directory))
            name = package.partition("@")[0]
            with tarfile.open(Path(directory, package.replace("@", "-") + ".tgz")) as archive:
                for file in files:
                    member = archive.extractfile(f"package/{file}")
                    if member is None:
                        raise SystemExit(f"{package} has no {file}")
                    path = VENDOR / name / file
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(_with_paths(member.read(), path))
    files = sorted(path for path in VENDOR.rglob("*") if path.is_file() and path.name != SUMS)
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(VENDOR)}\n" for path in files]
    (VENDOR / SUMS).write_text("".join(lines))


def _pack(package: str, directory: Path) -> None:
    subprocess.run(["npm", "pack", "--silent", package], cwd=directory, check=True, stdout=subprocess.DEVNULL)


def _with_paths(text: bytes, path: Path) -> bytes:
    """A module in which paths take the place of names of modules."""
    if path.suffix != ".js":
        return text

    def to(target: str) -> bytes:
        relative = os.path.relpath(VENDOR / "three" / target, path.parent)
        return (relative if relative.startswith(".") else f"./{relative}").encode()

    text = re.sub(rb"(\bfrom\s+['\"])three(['\"];)", lambda m: m[1] + to("build/three.module.js") + m[2], text)
    return re.sub(
        rb"(\bfrom\s+['\"])three/(examples/jsm/[^'\"]+)(['\"];)", lambda m: m[1] + to(m[2].decode()) + m[3], text
    )


if __name__ == "__main__":
    main()
