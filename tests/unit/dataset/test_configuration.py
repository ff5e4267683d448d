"""A dataset whose configuration is missing or damaged is damaged, and errors say how to restore it."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

import throwcollect
from throwcollect.collect.coordinator.resume import resume
from throwcollect.collect.runs.preparation import resume as prepare_to_resume
from throwcollect.config.loader import load
from throwcollect.dataset.inspect import info
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import DatasetError


def lose(path: Path) -> None:
    path.unlink()


def tear(path: Path) -> None:
    path.write_bytes(path.read_bytes() + b"x")


def put_a_link(path: Path) -> None:
    os.rename(path, path.parent.parent / "elsewhere.yaml")
    path.symlink_to(path.parent.parent / "elsewhere.yaml")


@pytest.mark.parametrize("look", [throwcollect.load, info, prepare_to_resume])
@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lose, "no such file"),
        (tear, "not valid YAML"),
        (put_a_link, "a symbolic link"),
    ],
)
def test_a_missing_or_damaged_configuration_is_an_error_of_the_dataset(
    dataset: Path, damage: Callable[[Path], None], said: str, look: Callable[[Path], object]
) -> None:
    damage(dataset / "config.yaml")
    with pytest.raises(DatasetError, match=rf"config\.yaml: .*{said}"):
        look(dataset)


def test_resuming_with_the_original_file_restores_a_missing_configuration(dataset: Path, tmp_path: Path) -> None:
    config = load(dataset / "config.yaml")
    (dataset / "config.yaml").unlink()
    with pytest.raises(DatasetError, match=r"\n  try: throwcollect up CONFIG --resume .*/dataset, with the conf"):
        info(dataset)
    resume(config, dataset, sweep_directory=tmp_path)
    with closing(DatasetWriter.open(dataset)) as writer:
        writer.recover()
        writer.finish()
    assert verify(dataset) == []
