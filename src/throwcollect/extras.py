"""The extras of the distribution: which of them brings a package, and what is said where that package is missing.

`pip install throwcollect` reads, exports and derives datasets and checks configurations, on any Python from 3.10 on.
What simulating, containers, reports and further formats need besides comes with extras, such as
`pip install 'throwcollect[collect]'`; `docs/installing.md` lists them. Modules that cannot do without such a package
import it as any other; modules that can import it through `lazily`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any

from throwcollect.errors import ConfigError, ThrowcollectError

EXTRA_OF = MappingProxyType(
    {
        "cbor2": "serve",
        "cryptography": "collect",
        "pinocchio": "collect",
        "pybullet": "collect",
        "re2": "collect",
        "scipy": "collect",
        "setproctitle": "collect",
        "xxhash": "collect",
        "zenoh": "collect",
        "docker": "docker",
        "fastapi": "serve",
        "h5py": "export",
        "jinja2": "report",
        "matplotlib": "report",
        "mujoco": "mujoco",
        "onnx": "onnx",
        "orjson": "serve",
        "pandas": "pandas",
        "plotly": "report",
        "PIL": "report",
        "uvicorn": "serve",
        "websockets": "serve",
    }
)
"""The extra that brings a package, by the name under which the package is imported."""

_LAST_WITH_BULLET = (3, 11)
"""The latest Python that pybullet has a wheel for. A Bullet that is compiled anew computes other bytes."""

_FIRST_WITH_MUJOCO = (3, 11)
"""The first Python that MuJoCo has a wheel for."""


class MissingExtraError(ThrowcollectError, ImportError):
    """A package that an extra brings is not installed; nothing has been started.

    Attributes:
        package: Name under which the package is imported.
        extra: The extra that brings it.
    """

    exit_code = ConfigError.exit_code

    def __init__(self, package: str, extra: str | None = None) -> None:
        self.package = package
        self.extra = extra or EXTRA_OF[package]
        problem, hint = f"this needs {package}, which is not installed", install_command(self.extra)
        if not has_wheel(package):
            problem += f" and has no wheel for Python {sys.version_info[0]}.{sys.version_info[1]}"
            hint = _INSTEAD[package]
        super().__init__(problem, hint=hint)


_INSTEAD = {
    "pybullet": "Python 3.11, such as that of `uv venv --python 3.11`; without it, `sim.engine: mujoco` simulates "
    "other throws, `up --runtime docker` the same ones, and `dataset view` shows them",
    "mujoco": "Python 3.11 or later, or `sim.engine: bullet`",
}
"""What helps where an engine, which also draws pictures if it is Bullet, has no wheel for this Python."""


_SYSTEM_LIBRARY_OF = MappingProxyType({"pinocchio": ("libgomp.so.1", "libgomp1")})
"""The library that a package loads and no wheel brings, and the package of Debian that has it."""


class MissingLibraryError(ThrowcollectError, ImportError):
    """A package is installed, but this system lacks a library that it loads; nothing has been started.

    Attributes:
        package: Name under which the package is imported.
        library: File name of the library.
    """

    exit_code = ConfigError.exit_code

    def __init__(self, package: str) -> None:
        self.package = package
        self.library, system_package = _SYSTEM_LIBRARY_OF[package]
        super().__init__(
            f"{package} needs {self.library}, which this system lacks",
            hint=f"apt install {system_package}, or what has it in another system than Debian and Ubuntu",
        )


def has_wheel(package: str) -> bool:
    """Whether a package can be installed on this Python without being compiled.

    Args:
        package: Name under which it is imported.
    """
    python = sys.version_info[:2]
    if package == "pybullet":
        return python <= _LAST_WITH_BULLET
    return package != "mujoco" or python >= _FIRST_WITH_MUJOCO


def install_command(extra: str) -> str:
    """The command that installs an extra."""
    return f"pip install 'throwcollect[{extra}]'"


def is_installed(package: str) -> bool:
    """Whether a package can be imported, judged without importing it."""
    spec = find_spec(package)
    # Without an origin it is any directory of that name, such as `docker` where `python -m` is run in a clone.
    return spec is not None and spec.origin is not None


def require(*packages: str, extra: str | None = None) -> None:
    """Find out whether packages that an extra brings are installed, before anything is begun.

    Args:
        packages: Names under which they are imported.
        extra: The extra to name; None for the one that `EXTRA_OF` has.

    Raises:
        MissingExtraError: If one is not installed; it names the first.
    """
    for package in packages:
        if not is_installed(package):
            raise MissingExtraError(package, extra)


@contextmanager
def explain_missing(extra: str | None = None) -> Iterator[None]:
    """Have imports in the block say which extra they lack.

    Args:
        extra: The extra to name; None for the one that `EXTRA_OF` has.

    Raises:
        MissingExtraError: If a package that an extra brings is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in EXTRA_OF:
            raise
        raise MissingExtraError(package, extra) from error


def lazily(name: str, *, extra: str | None = None) -> Any:
    """A module that is imported when something of it is used for the first time.

    Args:
        name: Full name of a module of a package in `EXTRA_OF`.
        extra: The extra to name where the package is missing; None for the one that `EXTRA_OF` has.

    Returns:
        Stands for the module. Asking it for an attribute raises `MissingExtraError` if the package is not installed,
        and `MissingLibraryError` if it is, without a library of the system that it loads.
    """
    return _LazyModule(name, extra)


def _lacks_library(package: str) -> bool:
    """Whether a package is there, and a library of the system that it loads is not."""
    if package not in _SYSTEM_LIBRARY_OF or not is_installed(package):
        return False
    import ctypes  # takes 7 ms, and nobody needs it who has the library

    try:
        ctypes.CDLL(_SYSTEM_LIBRARY_OF[package][0])
    except OSError:
        return True
    return False


class _LazyModule:
    """See `lazily`."""

    def __init__(self, name: str, extra: str | None) -> None:
        self._name, self._extra = name, extra

    def __getattr__(self, attribute: str) -> Any:
        with explain_missing(self._extra):
            try:
                module = import_module(self._name)
            except ImportError as error:
                if _lacks_library(self._name):
                    raise MissingLibraryError(self._name) from error
                raise
        value = getattr(module, attribute)
        # The next look-up finds the value here and does not come by this function.
        setattr(self, attribute, value)
        return value
