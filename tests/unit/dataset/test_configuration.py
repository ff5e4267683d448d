"""A dataset whose configuration is missing or damaged is damaged, and errors say how to restore it."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import throwcollect
from throwcollect.config.loader import load
from throwcollect.coordinator.resume import resume
from throwcollect.dataset.creation import create
from throwcollect.dataset.inspect import info
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import ConfigError, DatasetError, Problem
from throwcollect.runs.preparation import resume as prepare_to_resume


def lose(path: Path) -> None:
    path.unlink()


def tear(path: Path) -> None:
    path.write_bytes(path.read_bytes() + b"x")


def put_a_link(path: Path) -> None:
    os.rename(path, path.parent.parent / "elsewhere.yaml")
    path.symlink_to(path.parent.parent / "elsewhere.yaml")


def spoil(path: Path) -> None:
    path.write_text(path.read_text().replace("trials: ", "trails: "))


@pytest.mark.parametrize("look", [throwcollect.load, info, prepare_to_resume])
@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lose, "no such file"),
        (tear, "not valid YAML"),
        (put_a_link, "a symbolic link"),
        (spoil, "trails: unknown key"),
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
        writer.finish(wall_s=None)
    assert verify(dataset) == []


def test_an_unfinished_dataset_without_its_configuration_is_an_error(collection: Any, tmp_path: Path) -> None:
    create(tmp_path / "dataset", collection.plan)
    (tmp_path / "dataset" / "config.yaml").unlink()
    for look in (throwcollect.load, prepare_to_resume):
        with pytest.raises(DatasetError, match=r"config\.yaml: no such file\n  try: throwcollect up CONFIG --resume"):
            look(tmp_path / "dataset")


def test_resuming_a_directory_of_recordings_alone_asks_for_the_configuration(dataset: Path, tmp_path: Path) -> None:
    for name in ("config.yaml", "plan.parquet", "metadata.yaml"):
        (dataset / name).unlink()
    with pytest.raises(DatasetError, match=r"config\.yaml: no such file\n  try: throwcollect up CONFIG --resume"):
        prepare_to_resume(dataset)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").touch()
    with pytest.raises(ConfigError, match="holds no dataset"):
        prepare_to_resume(tmp_path / "other")


@pytest.mark.parametrize("storage", StoragePlugin)
def test_a_bag_of_another_program_is_no_dataset(storage: StoragePlugin, tmp_path: Path) -> None:
    path, store = tmp_path / "bag", get_typestore(Stores.ROS2_JAZZY)
    text = store.types["std_msgs/msg/String"]
    with Writer(path, version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection("/chatter", text.__msgtype__, typestore=store)
        writer.write(connection, 0, store.serialize_cdr(text(data="hello"), text.__msgtype__))
    for look in (info, verify, throwcollect.load):
        with pytest.raises(DatasetError, match=f"^{path}: is a rosbag2 bag, but not of throwcollect$"):
            look(path)
    with pytest.raises(ConfigError, match=f"^{path}: is a rosbag2 bag, but not of throwcollect\n"):
        prepare_to_resume(path)
    (path / "metadata.yaml").unlink()
    with pytest.raises(DatasetError, match=f"^{path}: holds no dataset$"):
        info(path)


def test_a_dataset_with_pointers_of_git_lfs_is_refused_as_it_is(dataset: Path) -> None:
    for path in (dataset / "plan.parquet", *dataset.glob("*.mcap")):
        path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0123\nsize 12345\n")
    before = {path: path.read_bytes() for path in dataset.iterdir() if path.is_file()}
    for look in (info, verify, throwcollect.load, prepare_to_resume):
        with pytest.raises(
            DatasetError, match=r"/dataset/\S+: a Git LFS pointer is in its place\n  try: git lfs pull$"
        ):
            look(dataset)
    assert before == {path: path.read_bytes() for path in dataset.iterdir() if path.is_file()}


def test_a_configuration_that_needs_a_missing_package_is_not_damaged(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robot or the task may come from another package, which is not installed here."""
    from throwcollect.dataset import configuration

    def refuse(_: Path) -> None:
        path = dataset / "config.yaml"
        raise ConfigError([Problem("no package brings it", key="task.name", path=path)])

    monkeypatch.setattr(configuration, "load", refuse)
    with pytest.raises(ConfigError, match="no package brings it"):
        info(dataset)
