"""A dataset may come from a stranger: links in it must not make us read, change or remove files elsewhere."""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.mutations import SETTINGS, finish

from throwcollect.collect.coordinator.resume import resume
from throwcollect.dataset.derive.derivation import filter_trials
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import ThrowcollectError

BEGUN = "quick_00001.mcap.part"
UNFINISHED = (
    "config.yaml.new",
    "plan.parquet.new",
    "throws.parquet.new",
    "metadata.yaml.new",
    "quick_00000.mcap.new",
)
REPLACED = ("plan.parquet", "throws.parquet", "README.md", "config.yaml")
REFUSED = ("quick_00000.mcap", BEGUN, "logs", "logs/journal.jsonl")


@pytest.fixture(scope="module")
def source() -> Collection:
    return Collection(SETTINGS)


@pytest.fixture(scope="module")
def sound(source: Collection, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return source.collect(tmp_path_factory.mktemp("sound") / "dataset")


def go_on(directory: Path, source: Collection) -> None:
    """Resume as the processes of `up --resume` do."""
    resume(source.config, directory, sweep_directory=directory)
    writer = DatasetWriter.open(directory)
    try:
        there: list[int] = []
        writer.recover(lambda trial, _: there.append(trial) is None)
        source.fill(writer, [trial for trial in range(len(source.plan.trials)) if trial not in there])
        writer.finish()
    finally:
        writer.close()


USES: dict[str, Callable[[Path, Collection, Path], object]] = {
    "resume": lambda directory, source, _: go_on(directory, source),
    "finish": lambda directory, _source, _: finish(directory),
    "filter": lambda directory, _source, output: filter_trials(directory, output, where="outcome == 'landed'"),
    "verify": lambda directory, _source, _: verify(directory),
}


def lead_out(directory: Path, name: str, outside: Path) -> None:
    """Replace a file or directory of the dataset by a link to one with the same contents outside."""
    place = directory / name
    outside.mkdir(parents=True)
    target = outside / "target"
    if name == "logs":
        target.mkdir()
        (target / "journal.jsonl").write_text("mine")
    elif place.exists():
        shutil.move(place, target)
    elif name == BEGUN:
        shutil.move(directory / "quick_00001.mcap", target)
    else:
        target.write_text("mine")
    place.parent.mkdir(exist_ok=True)
    place.symlink_to(target)


def contents(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


@pytest.mark.parametrize("use", USES)
def test_links_in_the_place_of_temporary_files_are_not_followed(
    source: Collection, sound: Path, tmp_path: Path, use: str
) -> None:
    directory = Path(shutil.copytree(sound, tmp_path / "dataset"))
    names = (*UNFINISHED, "quick_00000.mcap.part") if use == "resume" else UNFINISHED
    for number, name in enumerate(names):
        lead_out(directory, name, tmp_path / "outside" / str(number))
    before = contents(tmp_path / "outside")
    USES[use](directory, source, tmp_path / "output")
    assert contents(tmp_path / "outside") == before
    if use == "resume":
        assert verify(directory) == []


@pytest.mark.parametrize("name", REPLACED)
def test_a_link_in_the_place_of_a_file_that_can_be_made_again_is_replaced(
    source: Collection, sound: Path, tmp_path: Path, name: str
) -> None:
    directory = Path(shutil.copytree(sound, tmp_path / "dataset"))
    lead_out(directory, name, tmp_path / "outside")
    before = contents(tmp_path / "outside")
    go_on(directory, source)
    assert contents(tmp_path / "outside") == before
    assert not (directory / name).is_symlink()
    assert name in ("README.md", "provenance.json") or (directory / name).read_bytes() == (sound / name).read_bytes()


@pytest.mark.parametrize(
    ("use", "name"),
    [
        *(("resume", name) for name in REFUSED),
        *(("filter", name) for name in ("config.yaml", "plan.parquet", "quick_00000.mcap")),
    ],
)
def test_a_link_in_the_place_of_a_file_that_must_be_read_is_refused(
    source: Collection, sound: Path, tmp_path: Path, use: str, name: str
) -> None:
    directory = Path(shutil.copytree(sound, tmp_path / "dataset"))
    lead_out(directory, name, tmp_path / "outside")
    before = contents(tmp_path / "outside")
    with pytest.raises(ThrowcollectError, match=rf"{name}.*: cannot be .*: a symbolic link leads elsewhere\n  try: "):
        USES[use](directory, source, tmp_path / "output")
    assert contents(tmp_path / "outside") == before


@pytest.mark.parametrize("name", ["config.yaml", "plan.parquet", "quick_00000.mcap", "logs/journal.jsonl"])
def test_verify_and_resume_do_not_wait_for_a_pipe_in_the_place_of_a_file(
    source: Collection, sound: Path, tmp_path: Path, name: str
) -> None:
    directory = Path(shutil.copytree(sound, tmp_path / "dataset"))
    (directory / name).unlink(missing_ok=True)
    (directory / name).parent.mkdir(exist_ok=True)
    os.mkfifo(directory / name)

    finished: list[bool] = []

    def use_dataset() -> None:
        for use in ("verify", "resume"):
            with suppress(ThrowcollectError):
                USES[use](directory, source, tmp_path / "output")
        finished.append(True)

    # Nobody writes into the pipe, so a thread that waits for it never ends.
    using = threading.Thread(target=use_dataset, daemon=True)
    using.start()
    using.join(timeout=30)
    assert finished


def test_a_dataset_can_be_resumed_through_a_link_to_its_directory(
    source: Collection, sound: Path, tmp_path: Path
) -> None:
    directory = Path(shutil.copytree(sound, tmp_path / "dataset"))
    (tmp_path / "named").symlink_to(directory)
    (directory / "quick_00001.mcap").unlink()
    go_on(tmp_path / "named", source)
    assert verify(tmp_path / "named") == []
