"""Build backend (PEP 517): generates the code of ROS 2 interfaces, compiles it, and packs it into one wheel.

It ends with one sentence where a machine cannot do that; frontends show what a backend prints. To say so on any Python,
this module and `machine` do without what older ones lack, and all else is imported after the check.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from builder import machine

_EPOCH = "315532800"
"""1980-01-01, where the time stamps of archives begin: they say nothing of when a wheel was built."""


def get_requires_for_build_wheel(config_settings: dict[str, object] | None = None) -> list[str]:  # noqa: ARG001
    """Requirements of a build beyond those in `pyproject.toml`.

    Returns:
        Everything that the generated code is generated and compiled with, pinned.

    Raises:
        SystemExit: If this machine cannot build; with the sentence that says what to do.
    """
    machine.check()
    from builder.project import PROJECT

    return sorted({*PROJECT.generators, *(name for name in PROJECT.dependencies if name.startswith("ros-"))})


def prepare_metadata_for_build_wheel(metadata_directory: str, config_settings: dict[str, object] | None = None) -> str:  # noqa: ARG001
    """Write the wheel's metadata without building it.

    Args:
        metadata_directory: Where the `.dist-info` directory goes.
        config_settings: Nothing can be set.

    Returns:
        Name of the `.dist-info` directory.

    Raises:
        SystemExit: If this machine cannot build.
    """
    machine.check()
    from builder import archive

    return archive.write_metadata(Path(metadata_directory)).name


def build_wheel(
    wheel_directory: str,
    config_settings: dict[str, object] | None = None,  # noqa: ARG001
    metadata_directory: str | None = None,  # noqa: ARG001
) -> str:
    """Build the wheel; the same bytes from the same definitions with the same compiler.

    Args:
        wheel_directory: Where it goes.
        config_settings: Nothing can be set.
        metadata_directory: Metadata that was prepared; it is the same again.

    Returns:
        File name of the wheel.

    Raises:
        SystemExit: If this machine cannot build, or the compiler fails.
    """
    machine.check()
    # The generators come from wheels that are there only now.
    from builder import archive, compilation, generation, layout
    from builder.project import PROJECT

    os.environ.setdefault("SOURCE_DATE_EPOCH", _EPOCH)
    with tempfile.TemporaryDirectory(prefix="ros-interfaces-") as temporary:
        work = Path(temporary).resolve()
        prefix = generation.find_prefix()
        generated = generation.generate(PROJECT, prefix, work / "generated")
        libraries = compilation.compile_all(PROJECT, generated, prefix, work)
        tree = work / "wheel"
        layout.lay_out(PROJECT, generated, libraries, tree)
        return archive.write_wheel(tree, Path(wheel_directory)).name


def build_sdist(sdist_directory: str, config_settings: dict[str, object] | None = None) -> str:  # noqa: ARG001
    """Write the source archive, which carries the definitions; the same bytes from the same sources.

    Args:
        sdist_directory: Where it goes.
        config_settings: Nothing can be set.

    Returns:
        File name of the archive.
    """
    from builder import archive

    os.environ.setdefault("SOURCE_DATE_EPOCH", _EPOCH)
    return archive.write_sdist(Path(sdist_directory)).name
