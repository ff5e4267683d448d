"""The extras of the distribution: the packages that they bring, and the errors if such a package is missing.

`pip install throwcollect` reads, exports and derives datasets and checks configurations, on any Python from 3.10 on.
Extras such as `pip install 'throwcollect[collect]'` bring the packages for simulating, containers, reports and further
formats; `docs/installing.md` lists them. A module that is useless without such a package imports it in the usual way; a
module that is useful even without the package imports it through `lazily`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any, NamedTuple

from throwcollect.errors import ConfigError, ThrowcollectError

EXTRA_OF = MappingProxyType(
    {
        "av": "video",
        "cbor2": "serve",
        "cryptography": "collect",
        "pinocchio": "collect",
        "pybullet": "collect",
        "xxhash": "collect",
        "zenoh": "collect",
        "docker": "docker",
        "fastapi": "serve",
        "gymnasium": "gym",
        "h5py": "export",
        "scipy": "export",
        "jinja2": "report",
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
"""The extra that brings a package, by the name of the package in imports."""


class EnginePackage(NamedTuple):
    """The package of an engine: its names on the package index and in imports, and a pattern of its compiled file."""

    distribution: str
    module: str
    compiled: str


ENGINE_PACKAGES = MappingProxyType(
    {
        "bullet": EnginePackage("pybullet", "pybullet", "pybullet.*.so"),
        "mujoco": EnginePackage("mujoco-core", "mujoco", "libmujoco.so.*"),
    }
)
"""The package of each engine of our own that needs one, by name of the engine."""

_WHEELS = {
    # Compiling Bullet would not help, because it would compute other bytes.
    "pybullet": (
        ((3, 10), (3, 11)),
        "Python 3.11, such as that of `uv venv --python 3.11`; or `up --runtime docker`; or, instead of the default "
        "engine bullet, `--set sim.engine=mujoco`, whose throws land some millimetres elsewhere",
    ),
    "mujoco": (((3, 11), (3, 99)), "Python 3.11 or later, or `sim.engine: bullet`"),
}
"""The first and the last Python with a wheel of a package, and the hint for all others."""


class MissingExtraError(ThrowcollectError, ImportError):
    """A package, by its name in imports, that an extra brings is not installed; nothing has been started."""

    exit_code = ConfigError.exit_code

    def __init__(self, package: str) -> None:
        self.package, self.extra = package, EXTRA_OF.get(package, "collect")
        problem, hint = f"this needs {package}, which is not installed", install_command(self.extra)
        if not has_wheel(package):
            problem += f" and has no wheel for Python {sys.version_info[0]}.{sys.version_info[1]}"
            hint = _WHEELS[package][1]
        super().__init__(problem, hint=hint)


def has_wheel(package: str) -> bool:
    """Whether a package can be installed on this Python without a compiler."""
    (first, last), _ = _WHEELS.get(package, (((3, 0), (3, 99)), ""))
    return first <= sys.version_info[:2] <= last


def install_command(extra: str) -> str:
    """Write the command that installs an extra."""
    return f"pip install 'throwcollect[{extra}]'"


def is_installed(package: str) -> bool:
    """Whether a package can be imported, without importing it."""
    spec = find_spec(package)
    # Any directory of that name has a spec without an origin, such as `docker` if `python -m` runs in a clone.
    return spec is not None and spec.origin is not None


def require(*packages: str) -> None:
    """Check that packages of `EXTRA_OF`, by their names in imports, are installed, before anything begins."""
    for package in packages:
        if not is_installed(package):
            raise MissingExtraError(package)


def require_engine(name: str) -> None:
    """Check that the package of an engine is installed, before anything begins."""
    if name in ENGINE_PACKAGES:
        require(ENGINE_PACKAGES[name].module)


@contextmanager
def explain_missing() -> Iterator[None]:
    """Turn a failed import of a package in `EXTRA_OF` in the block into an error that names the extra."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in EXTRA_OF:
            raise
        raise MissingExtraError(package) from error


def import_public(module: str, places: Mapping[str, str], name: str) -> Any:
    """Import the object with a public name of a module, from its place below `throwcollect`: module and attribute.

    Raises:
        AttributeError: If there is no such name.
        MissingExtraError: If the object needs an extra that is not installed.
    """
    if name not in places:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    inside, _, attribute = places[name].partition(":")
    with explain_missing():
        found = import_module(f"throwcollect.{inside}")
    return getattr(found, attribute) if attribute else found


def lazily(name: str) -> Any:
    """Make a stand-in for a module, which imports the module when it is first used.

    Using an attribute raises `MissingExtraError` if the package of an extra is not installed, and `ConfigError` if the
    system lacks a library that the package loads.
    """
    return _LazyModule(name)


class _LazyModule:
    """See `lazily`."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        with explain_missing():
            try:
                module = import_module(self._name)
            except ImportError as error:
                if ".so" not in str(error):
                    raise
                # The loader names the library the system lacks, such as libgomp.so.1 of Pinocchio.
                hint = "docs/installing.md names the libraries of the system that are needed"
                raise ConfigError(f"{self._name} cannot be loaded: {error}", hint=hint) from error
        # This is outside of the block above, because a missing attribute is an error of the caller.
        value = getattr(module, attribute)
        # The next look-up finds the value in the instance, and does not call this function.
        setattr(self, attribute, value)
        return value
