"""What is to be built, as `pyproject.toml` says it, and where its files are: in the clone, or in the source archive."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tomllib

ROOT = Path(__file__).resolve().parents[1]
"""Directory of this project."""
_CLONE = ROOT.parents[1]


@dataclass(frozen=True)
class Package:
    """A ROS package with interfaces.

    Attributes:
        name: Such as ``control_msgs``.
        version: Of the release that the definitions are of.
        license: Of the definitions, as SPDX writes it.
        source: Repository that the definitions are from.
        depends: Packages whose interfaces it uses, with those that the generators put in.
        files: Definitions, relative to the package: ``msg/JointTolerance.msg``.
        directory: Where these are.
    """

    name: str
    version: str
    license: str
    source: str
    depends: tuple[str, ...]
    files: tuple[Path, ...]
    directory: Path


@dataclass(frozen=True)
class Project:
    """This project.

    Attributes:
        name: Of the distribution.
        version: Of the distribution.
        description: One line.
        requires_python: As metadata say it.
        dependencies: At run time.
        generators: Needed beside the dependencies to build.
        packages: What is built.
    """

    name: str
    version: str
    description: str
    requires_python: str
    dependencies: tuple[str, ...]
    generators: tuple[str, ...]
    packages: tuple[Package, ...]

    @property
    def stem(self) -> str:
        """Name and version as file names have them."""
        return f"{self.name.replace('-', '_')}-{self.version}"


def definitions() -> Path:
    """Directory of the definitions: ``<package>/{msg,srv,action}/<name>.<kind>``."""
    carried = ROOT / "definitions"
    return carried if carried.is_dir() else _CLONE / "src" / "rclzenoh" / "interfaces" / "definitions"


def license_files() -> tuple[Path, ...]:
    """Texts of the licences: Apache-2.0, and that of the definitions under BSD-3-Clause."""
    carried = ROOT / "LICENSE"
    return (carried if carried.is_file() else _CLONE / "LICENSE", ROOT / "LICENSE.BSD")


def _read() -> Project:
    document = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project, ours = document["project"], document["tool"]["ros-interfaces"]
    packages = []
    for name, facts in ours["packages"].items():
        directory = definitions() / name
        found = (path for kind in ("msg", "srv", "action") for path in directory.glob(f"{kind}/*.{kind}"))
        files = tuple(sorted(path.relative_to(directory) for path in found))
        packages.append(
            Package(
                name,
                facts["version"],
                facts["license"],
                facts["source"],
                tuple(facts["depends"]),
                files,
                directory,
            )
        )
    return Project(
        project["name"],
        project["version"],
        project["description"],
        project["requires-python"],
        tuple(project["dependencies"]),
        tuple(ours["generators"]),
        tuple(packages),
    )


PROJECT = _read()
