"""A dataset whose configuration is missing or damaged is damaged, and errors say how to restore it."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import throwcollect
from throwcollect.config.loader import load
from throwcollect.coordinator.resume import resume
from throwcollect.dataset.inspect import info
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.runs.preparation import resume as prepare_to_resume


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


@pytest.mark.parametrize("look", [throwcollect.load, info, prepare_to_resume])
def test_a_wrong_key_in_the_configuration_of_a_dataset_has_the_hint_that_restores_it(
    dataset: Path, look: Callable[[Path], object]
) -> None:
    path = dataset / "config.yaml"
    path.write_text(path.read_text().replace("trials: ", "trails: "))
    with pytest.raises(ConfigError, match=r"config\.yaml:\d+: trails: unknown key.*\n  try: .* up CONFIG --resume "):
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


def test_a_bag_of_another_program_is_no_dataset(tmp_path: Path) -> None:
    path, store = tmp_path / "bag", get_typestore(Stores.ROS2_JAZZY)
    text = store.types["std_msgs/msg/String"]
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/chatter", text.__msgtype__, typestore=store)
        writer.write(connection, 0, store.serialize_cdr(text(data="hello"), text.__msgtype__))
    for look in (info, verify, throwcollect.load):
        with pytest.raises(DatasetError, match=f"^{path}: is a rosbag2 bag, but not of throwcollect$"):
            look(path)
    with pytest.raises(ConfigError, match=f"^{path}: is a rosbag2 bag, but not of throwcollect\n"):
        prepare_to_resume(path)


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
