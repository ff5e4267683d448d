"""Lays out the files of the wheel as installed ROS packages are: modules, libraries, and what `ros2` tools read."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.sax.saxutils import escape

from builder.compilation import Library
from builder.generation import Generated
from builder.project import PROJECT, Package, Project


def lay_out(project: Project, generated: Generated, libraries: list[Library], tree: Path) -> None:
    """Put together what goes into the wheel.

    Args:
        project: What is built.
        generated: Where the generated code is.
        libraries: The libraries that were built.
        tree: Where the wheel's files go; what is below `.data/data` is installed into the environment's directory.
    """
    data = tree / f"{PROJECT.stem}.data" / "data"
    for package in project.packages:
        for module in sorted((generated.python / package.name).glob("*/*.py")):
            _copy(module, tree / module.relative_to(generated.python))
        (tree / package.name / "__init__.py").touch()
        for file in package.files:
            for suffix in (file.suffix, ".idl", ".json"):
                path = Path(package.name) / file.with_suffix(suffix)
                _copy(generated.share / path, data / "share" / path)
        _write_resources(package, data / "share")
    for library in libraries:
        into = tree / library.package.name if library.is_module else data / "lib"
        _copy(library.path, into / library.path.name)
        (into / library.path.name).chmod(0o755)


def _write_resources(package: Package, share: Path) -> None:
    index = share / "ament_index" / "resource_index"
    interfaces = sorted(path.as_posix() for file in package.files for path in (file, file.with_suffix(".idl")))
    _write(index / "packages" / package.name, "")
    _write(index / "package_run_dependencies" / package.name, ";".join(package.depends))
    _write(index / "rosidl_interfaces" / package.name, "\n".join(interfaces))
    facts = {
        "name": package.name,
        "version": package.version,
        "description": f"Those interfaces of {package.name} that throwcollect speaks.",
        "license": package.license,
        "url": package.source,
    }
    lines = [f"  <{tag}>{escape(text)}</{tag}>" for tag, text in facts.items()]
    lines += [f"  <depend>{name}</depend>" for name in package.depends]
    lines += ["  <member_of_group>rosidl_interface_packages</member_of_group>"]
    _write(share / package.name / "package.xml", "\n".join(['<package format="3">', *lines, "</package>", ""]))


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)
