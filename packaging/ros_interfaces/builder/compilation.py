"""Compiles generated code to the libraries that ROS' own build makes, by the same names."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from builder.generation import IMPLEMENTATIONS, Generated
from builder.machine import compilers
from builder.project import Package, Project

_RUNTIME = (
    "rcutils",
    "rmw",
    "rosidl_runtime_c",
    "rosidl_typesupport_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_fastrtps_cpp",
    "rosidl_typesupport_introspection_c",
)
_DESCRIPTION = "__description"
_SUPPORTS = ("rosidl_typesupport_c", *IMPLEMENTATIONS)


@dataclass(frozen=True)
class Library:
    """A shared library that was built.

    Attributes:
        package: Package that it belongs to.
        path: Where it is.
        is_module: Whether Python imports it; other libraries are found by the loader.
    """

    package: Package
    path: Path
    is_module: bool


def compile_all(project: Project, generated: Generated, prefix: Path, work: Path) -> list[Library]:
    """Compile and link the code of all packages, on all cores.

    Args:
        project: What is to be built.
        generated: Where the code is.
        prefix: Directory that the ROS wheels are in.
        work: Where objects and libraries go; no path below it gets into them.

    Returns:
        The libraries.

    Raises:
        SystemExit: If a compiler fails; with what it said.
    """
    c, cxx = compilers()
    headers = [path for path in sorted((prefix / "include").iterdir()) if (path / path.name).is_dir()]
    ours = (generated.structures, generated.introspection, generated.fastrtps)
    # Generated code copies fields, for a handful of messages in each throw, so more than -O1 only takes time.
    flags = ["-O1", "-DNDEBUG", "-fPIC", "-g0", f"-ffile-prefix-map={work}=."]
    flags += [f"-I{path}" for path in (*ours, *headers, prefix / "include")]
    c = [*c, "-std=gnu11", *flags, f"-I{sysconfig.get_path('include')}", f"-I{np.get_include()}"]
    cxx = [*cxx, "-std=c++17", *flags]
    targets = [
        target
        for package in project.packages
        for target in _Targets(work / "libraries", generated, prefix, cxx[0]).of(package)
    ]
    units = {target.library: _join_sources(target, work / "units") for target in targets}

    def compile_unit(unit: Path) -> None:
        _run([*(cxx if unit.suffix == ".cpp" else c), "-c", str(unit), "-o", str(_object_of(unit))])

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        list(pool.map(compile_unit, [unit for target in targets for unit in units[target.library]]))
    for target in targets:
        target.library.path.parent.mkdir(parents=True, exist_ok=True)
        objects = [str(_object_of(unit)) for unit in units[target.library]]
        _run([*target.command, *objects, *target.links])
    return [target.library for target in targets]


@dataclass(frozen=True)
class _Target:
    library: Library
    sources: list[Path]
    command: list[str]
    links: list[str]


@dataclass(frozen=True)
class _Targets:
    directory: Path
    generated: Generated
    prefix: Path
    linker: str

    def of(self, package: Package) -> list[_Target]:
        """What is linked for a package, each after what it needs."""
        code = self.generated
        suffix = sysconfig.get_config_var("EXT_SUFFIX")
        python = code.python / package.name
        kinds = [
            ("rosidl_generator_c", code.structures / package.name, "*/detail/*.c"),
            ("rosidl_typesupport_introspection_c", code.introspection / package.name, "*/detail/*.c"),
            ("rosidl_typesupport_fastrtps_c", code.fastrtps / package.name, "*/detail/*.cpp"),
            ("rosidl_typesupport_c", code.dispatch / package.name, "*/*.cpp"),
            ("rosidl_generator_py", python, "*/*_s.c"),
        ]
        targets, linked = [], []
        for kind, root, pattern in kinds:
            path = self.directory / f"lib{package.name}__{kind}.so"
            others = [self.prefix / "lib" / f"lib{name}__{kind}.so" for name in package.depends]
            structures = [self.prefix / "lib" / f"lib{name}__rosidl_generator_c.so" for name in package.depends]
            links = [str(each) for each in (*linked, *others, *structures) if each.exists() or each in linked]
            # Symbols of Python are those of the process.
            complete = [] if kind == "rosidl_generator_py" else ["-Wl,--no-undefined"]
            targets.append(self._target(Library(package, path, False), sorted(root.glob(pattern)), links, complete))
            linked.append(path)
        for support in _SUPPORTS:
            library = Library(package, self.directory / package.name / f"{package.name}_s__{support}{suffix}", True)
            source = python / f"_{package.name}_s.ep.{support}.c"
            targets.append(self._target(library, [source], list(map(str, linked)), []))
        return targets

    def _target(self, library: Library, sources: list[Path], links: list[str], more: list[str]) -> _Target:
        # `-s` takes out names that only linkers and debuggers read.
        command = [self.linker, "-shared", "-s", "-Wl,--as-needed", f"-Wl,-rpath-link={self.prefix / 'lib'}", *more]
        if not library.is_module:
            command.append(f"-Wl,-soname={library.path.name}")
        runtime = [f"-L{self.prefix / 'lib'}", *(f"-l{name}" for name in _RUNTIME), "-l:libfastcdr.so.2"]
        return _Target(library, sources, [*command, "-o", str(library.path)], [*links, *runtime])


def _join_sources(target: _Target, directory: Path) -> list[Path]:
    """Write the files that the compiler is given for a library: one that includes nearly all of its sources.

    The compiler reads the headers of ROS, which take most of its time, once for each file that it is given. Sources
    that describe types are given to it one by one, as each defines static names that the next one defines again.
    """
    joined = [source for source in target.sources if not source.stem.endswith(_DESCRIPTION)]
    if not joined:
        return target.sources
    unit = directory / target.library.path.with_suffix(joined[0].suffix).name
    unit.parent.mkdir(parents=True, exist_ok=True)
    unit.write_text("".join(f'#include "{source}"\n' for source in joined), encoding="utf-8")
    return [unit, *(source for source in target.sources if source not in joined)]


def _object_of(unit: Path) -> Path:
    return unit.with_suffix(f"{unit.suffix}.o")


def _run(command: list[str]) -> None:
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    if found.returncode:
        last = "\n".join(found.stderr.splitlines()[-20:])
        sys.exit(f"{command[0]} fails on generated code ({command[-1]}):\n{last}")
