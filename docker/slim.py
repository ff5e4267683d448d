"""Takes out of an environment what throwcollect never loads: ``python3 slim.py SITE_PACKAGES``.

The rules are those of one application: tests, headers, robots that are not built in, file systems in clouds. What they
take too much shows at the end of the image's build, when a collection runs with what is left.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Mapping
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

from elf import is_elf, list_needed, strip

DROPPED = (
    # For compilers, type checkers and developers.
    "*/tests/*",
    "*/include/*",
    "*.a",
    "*.h",
    "*.hpp",
    "*.pxd",
    "*.pxi",
    "*.pyi",
    "*.pyx",
    # Robots and scenes that come with the physics, and its renderer for servers with a graphics card.
    "eglRenderer*",
    "pybullet_*/*",
    # What draws, tells and identifies MuJoCo's worlds.
    "mujoco/_batch*",
    "mujoco/_render*",
    "mujoco/_rollout*",
    "mujoco/_simulate*",
    "mujoco/doc/*",
    "mujoco/introspect/*",
    "mujoco/plugin/*",
    "mujoco/sysid/*",
    "mujoco/testdata/*",
    # Tables in clouds and from other machines.
    "pyarrow/_azurefs*",
    "pyarrow/_flight*",
    "pyarrow/_gcsfs*",
    "pyarrow/_hdfs*",
    "pyarrow/_orc*",
    "pyarrow/_parquet_encryption*",
    "pyarrow/_dataset_orc*",
    "pyarrow/_dataset_parquet_encryption*",
    "pyarrow/_s3fs*",
    "pyarrow/_substrait*",
    "pyarrow/src/*",
    # Parts that samplers and exports do not use.
    "scipy/cluster/*",
    "scipy/datasets/*",
    "scipy/fftpack/*",
    "scipy/odr/*",
    "scipy/signal/*",
    # Recordings in the formats of rosbags: of that package, the interface definitions alone are used.
    "apsw/*",
    "backports/zstd/*",
    "lz4/*",
    # The second of two bindings to the same library.
    "zstandard/_cffi*",
    "zstandard/backend_cffi*",
    # Of ROS' wheels: what compiles against them, tools, and modules that only make a wheel one of a platform.
    "*.data/data/bin/fastdds",
    "*.data/data/bin/fast-discovery-server-*",
    "*.data/data/bin/nodesize_dbg",
    "*.data/data/bin/ros-discovery",
    "*.data/data/lib/cmake/*",
    "*.data/data/lib/foonathan_memory/*",
    "*.data/data/share/*",
    "*.data/data/tools/*",
    "*/_dummy.*.so",
    "*_s.c",
    "*_s.ep.*.c",
    # Nothing here prints source code in colour.
    "pygments/lexers/[a-z]*.py",
    # Nothing installs or removes packages later on.
    "*.dist-info/RECORD",
)

KEPT_OF_ROS = ("*.data/data/share/ament_index/*",)
"""What tells which RMWs are installed."""
CMEEL = "cmeel.prefix/*"
"""Where Pinocchio's packages put what others put into ``/usr``."""
KEPT_OF_CMEEL = (
    "cmeel.prefix/lib/lib*.so*",
    "cmeel.prefix/lib/python*/site-packages/coal/*",
    "cmeel.prefix/lib/python*/site-packages/eigenpy/*",
    "cmeel.prefix/lib/python*/site-packages/pinocchio/*",
    # The built-in robots.
    "cmeel.prefix/share/example-robot-data/robots/panda_description/*",
    "cmeel.prefix/share/example-robot-data/robots/so_arm_description/*/so101*",
    "cmeel.prefix/share/example-robot-data/robots/talos_data/*",
    "cmeel.prefix/share/example-robot-data/robots/tiago_description/*",
    "cmeel.prefix/share/example-robot-data/robots/ur_description/*/ur5*",
    "cmeel.prefix/share/example-robot-data/robots/xarm_description/*",
)

ENVIRONMENT = "environment.data/data"
"""Directory of the environment, where wheels put what is in their ``*.data/data``."""

COPIED = "ros_*.libs/*"
"""Libraries that ROS' wheels hold beside their own: the loader searches all these directories, and one copy does."""

LOADED_BY_NAME = ("lib*__rosidl_typesupport_*_c.so", "libllvmlite.so")
"""What no library says that it needs: of ROS, when a type is first used with Fast DDS, and of llvmlite."""

LIBRARY = re.compile(r"lib[^.]*\.so(\.\d+)*")
"""File names of libraries; those of modules say for which Python: ``lib.cpython-311-x86_64-linux-gnu.so``."""


def is_kept(path: str) -> bool:
    """Whether a file stays, as far as its name tells.

    Args:
        path: Relative to the directory of the packages, with slashes; or as a wheel has what goes elsewhere.
    """
    if any(fnmatchcase(path, pattern) for pattern in KEPT_OF_ROS):
        return True
    if fnmatchcase(path, CMEEL) and not any(fnmatchcase(path, pattern) for pattern in KEPT_OF_CMEEL):
        return False
    return not any(fnmatchcase(path, pattern) for pattern in DROPPED)


def find_unreached(files: Mapping[str, Callable[[], bytes]]) -> set[str]:
    """Shared libraries that no extension module loads, be it by way of others.

    Wheels hold a library up to three times, under the names that elsewhere are links to it; one of them is loaded.

    Args:
        files: What stays, by path: functions that read the content.

    Returns:
        Paths of the libraries.
    """
    shared = {path: list_needed(content) for path, read in files.items() if ".so" in path and is_elf(content := read())}
    libraries = {path for path in shared if LIBRARY.fullmatch(PurePosixPath(path).name)}
    by_name = {
        path for path in libraries if any(fnmatchcase(PurePosixPath(path).name, pattern) for pattern in LOADED_BY_NAME)
    }
    reached = set(shared) - libraries | by_name
    fresh = set(reached)
    while fresh:
        names = {name for path in fresh for name in shared[path]}
        fresh = {path for path in libraries - reached if PurePosixPath(path).name in names}
        reached |= fresh
    return libraries - reached


def find_repeated(files: Iterable[str]) -> set[str]:
    """Copies of libraries that ROS' wheels hold more than once, but for the first one of each name.

    Args:
        files: What stays, by path.

    Returns:
        Paths of the copies; their names have the hash of their content.
    """
    copies = [path for path in sorted(files) if fnmatchcase(path, COPIED)]
    first = {PurePosixPath(path).name: path for path in reversed(copies)}
    return set(copies) - set(first.values())


def slim(directory: Path) -> None:
    """Remove from a directory of installed packages what is not needed, and shorten what is.

    Args:
        directory: Such as ``lib/python3.11/site-packages`` of an environment.
    """
    files = {path.relative_to(directory).as_posix(): path for path in directory.rglob("*") if not path.is_dir()}
    if (directory / "ros_wheels_bootstrapper").is_dir():
        environment = directory.parents[2]
        beside = [path for path in environment.rglob("*") if directory.parents[0] not in path.parents]
        files |= {
            f"{ENVIRONMENT}/{path.relative_to(environment).as_posix()}": path for path in beside if path.is_file()
        }
    staying = {name: path for name, path in files.items() if is_kept(name)}
    superfluous = find_unreached({name: path.read_bytes for name, path in staying.items()}) | find_repeated(staying)
    for name, path in files.items():
        if name not in staying or name in superfluous:
            path.unlink()
        # Whatever is written, be it the same, is in one more layer of the image.
        elif ".so" in name and is_elf(content := path.read_bytes()) and (stripped := strip(content)) != content:
            path.write_bytes(stripped)
    for path in sorted(directory.rglob("*"), reverse=True):
        if path.is_dir() and not any(path.iterdir()):
            path.rmdir()


if __name__ == "__main__":
    slim(Path(sys.argv[1]))
