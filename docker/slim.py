"""Takes out of an environment what throwcollect never loads: ``python3 slim.py SITE_PACKAGES``.

The rules are those of one application: tests, headers, robots that are not built in, file systems in clouds. What they
take too much shows at the end of the image's build, when a collection runs with what is left.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Iterable
from fnmatch import fnmatchcase
from pathlib import Path

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
    "pyarrow/libarrow_flight*",
    "pyarrow/libarrow_s3*",
    "pyarrow/src/*",
    # Parts that samplers and exports do not use.
    "scipy/cluster/*",
    "scipy/datasets/*",
    "scipy/fftpack/*",
    "scipy/odr/*",
    "scipy/signal/*",
    # Compression that our recordings do not use.
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

PATCHED = "*.libs/*"
"""Libraries that `auditwheel` has put into wheels: it moves their parts, and `strip` would break them."""


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


def link_copies(libraries: Iterable[Path]) -> list[Path]:
    """Replace copies of a library by links to the first of them.

    Wheels hold a library up to three times, under the names that elsewhere are links to it; and those of ROS each hold
    the libraries that they share.

    Returns:
        The libraries that are no copies.
    """
    first: dict[bytes, Path] = {}
    for path in libraries:
        original = first.setdefault(hashlib.sha256(path.read_bytes()).digest(), path)
        if original is not path:
            path.unlink()
            path.symlink_to(os.path.relpath(original, path.parent))
    return list(first.values())


def strip(library: Path) -> None:
    """Remove the symbols for linkers and debuggers from a library."""
    shorter = library.with_name(f"{library.name}.stripped")
    subprocess.run(["strip", "--strip-unneeded", "-o", shorter, library], check=True)
    # Whatever is written, be it the same, is in one more layer of the image.
    if shorter.stat().st_size < library.stat().st_size:
        shorter.replace(library)
    else:
        shorter.unlink()


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
    for name, path in files.items():
        if not is_kept(name):
            path.unlink()
    libraries = {
        path: name for name, path in sorted(files.items()) if ".so" in name and path.is_file() and not path.is_symlink()
    }
    for path in link_copies(path for path in libraries if path.read_bytes()[:4] == b"\x7fELF"):
        if not fnmatchcase(libraries[path], PATCHED):
            strip(path)
    for path in sorted(directory.rglob("*"), reverse=True):
        if path.is_dir() and not any(path.iterdir()):
            path.rmdir()


if __name__ == "__main__":
    slim(Path(sys.argv[1]))
