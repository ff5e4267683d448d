"""Reads the configuration that lies in the directory of a dataset."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path

from throwcollect.config.loader import load, load_locating_errors
from throwcollect.config.schema import Config
from throwcollect.dataset.directory import CONFIG, config_path, describe_other, is_begun
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.wording import command


def read_config(directory: Path) -> Config:
    """Read the configuration of a dataset."""
    with _explaining_damage(directory):
        return load(config_path(directory))


@contextmanager
def reading_config(directory: Path, file: Path | None = None, overrides: Sequence[str] = ()) -> Iterator[Config]:
    """Read the configuration by which a dataset goes on, its own or that of a file, whose places errors name.

    The overrides are ``key=value`` pairs, as ``--set`` takes them.
    """
    if not is_begun(directory):
        raise ConfigError(
            f"{directory}: {describe_other(directory)}", expected="a directory that throwcollect up has made"
        )
    with ExitStack() as places:
        with nullcontext() if file else _explaining_damage(directory):
            config = places.enter_context(load_locating_errors(file or config_path(directory), overrides))
        yield config


@contextmanager
def _explaining_damage(directory: Path) -> Iterator[None]:
    """Add to errors of a dataset's own configuration how to restore it; those of the whole file are of the dataset."""
    try:
        yield
    except ConfigError as error:
        first = error.problems[0]
        # Overrides are in no file.
        if first.path != directory / CONFIG:
            raise
        # Nothing else in the directory holds the configuration.
        hint = f"{command('up', 'CONFIG', '--resume', directory)}, with the configuration that it was collected with"
        if first.key:
            raise ConfigError(error.problems, expected=error.expected, hint=error.hint or hint) from error
        place = f"line {first.line}" if first.line else ""
        raise DatasetError(first.message, path=first.path, place=place, hint=hint) from error
