"""Reads the configuration that lies in the directory of a dataset."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from throwcollect.config.loader import load, load_locating_errors
from throwcollect.config.schema import Config
from throwcollect.dataset.directory import CONFIG, config_path, describe_other, has_files
from throwcollect.dataset.manifest import is_begun, was_changed
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.files import refuse_pointers
from throwcollect.wording import command


def read_config(directory: Path) -> Config:
    """Read the configuration of a dataset."""
    try:
        return load(config_path(directory))
    except ConfigError as error:
        refuse_damaged_config(directory, error)
        raise


@contextmanager
def reading_config(directory: Path, file: Path | None = None, overrides: Sequence[str] = ()) -> Iterator[Config]:
    """Read the configuration by which a dataset goes on, its own or that of a file, whose places errors name.

    The overrides are ``key=value`` pairs, as ``--set`` takes them.
    """
    if not is_begun(directory):
        refuse_lost_config(directory)
        raise ConfigError(
            f"{directory}: {describe_other(directory)}", expected="a directory that throwcollect up has made"
        )
    refuse_pointers(directory)
    with ExitStack() as places:
        try:
            config = places.enter_context(load_locating_errors(file or config_path(directory), overrides))
        except ConfigError as error:
            # A problem without a place in a file is a problem of the overrides, which another file would not solve.
            if file or all(problem.path is None for problem in error.problems):
                raise
            refuse_damaged_config(directory, error)
            raise
        yield config


def refuse_damaged_config(directory: Path, error: ConfigError) -> None:
    """Refuse a dataset if damage of its configuration is the reason why reading it has ended with an error."""
    first = error.problems[0]
    # Without a key, it is the file itself that is wrong.
    if not first.key or was_changed(directory, CONFIG):
        place = ": ".join(filter(None, [f"line {first.line}" if first.line else "", first.key]))
        raise DatasetError(first.message, path=directory / CONFIG, place=place, hint=_restore(directory)) from error


def refuse_lost_config(directory: Path) -> None:
    """Refuse a directory that holds files of a dataset, but no configuration."""
    if has_files(directory) and not (directory / CONFIG).exists():
        raise DatasetError("no such file", path=directory / CONFIG, hint=_restore(directory))


def _restore(directory: Path) -> str:
    """Say how to get the configuration of a dataset back; nothing else in the directory holds it."""
    return f"{command('up', 'CONFIG', '--resume', directory)}, with the configuration that it was collected with"
