"""No damage makes a reader crash, hang or fill the memory: it reads, or raises an error of throwcollect."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.damage import records_of
from tests.unit.dataset.mutations import SETTINGS, Mutation, any_mutation, mutate, outcomes

from throwcollect.config.loader import load
from throwcollect.dataset.bag import from_yaml
from throwcollect.dataset.mcap_reader import open_mcap, scan_file
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throws_table import read_throws
from throwcollect.episode.chunk import Chunk
from throwcollect.errors import ThrowcollectError
from throwcollect.plan.plan import Plan

RECORDING = "quick_00000.mcap"
FILES = ("config.yaml", "metadata.yaml", "plan.parquet", "throws.parquet", RECORDING)

mutations = st.lists(
    any_mutation,
    min_size=1,
    max_size=4,
)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Collection(SETTINGS).collect(tmp_path_factory.mktemp("small") / "dataset")


@pytest.fixture(scope="module")
def sound(small: Path) -> Dataset:
    return Dataset.open(small)


def harmless(call: Callable[[], Any]) -> None:
    with suppress(ThrowcollectError):
        call()


@pytest.mark.filterwarnings("error")
@settings(deadline=None, max_examples=100)
@given(damage=mutations)
def test_a_recording_with_any_damage_is_read_or_refused(small: Path, sound: Dataset, damage: list[Mutation]) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / RECORDING
        path.write_bytes(mutate((small / RECORDING).read_bytes(), damage))
        for found in scan_file(path):
            assert found.episode.digest == sound.throws["digest"][0].as_py()

        def read() -> None:
            with open_mcap(path) as contents:
                for record in records_of(contents):
                    harmless(lambda offset=record.offset: contents.episode(offset)[0].samples())

        harmless(read)


@pytest.mark.filterwarnings("error")
@settings(deadline=None, max_examples=200)
@given(name=st.sampled_from(FILES[:4]), damage=mutations)
def test_a_table_with_any_damage_is_read_or_refused(
    small: Path, sound: Dataset, name: str, damage: list[Mutation]
) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / name
        path.write_bytes(mutate((small / name).read_bytes(), damage))
        readers: dict[str, Callable[[], Any]] = {
            "config.yaml": lambda: load(path),
            "metadata.yaml": lambda: from_yaml(path),
            "plan.parquet": lambda: Plan.read(path, sound.config),
            "throws.parquet": lambda: read_throws(path.parent, sound.plan),
        }
        harmless(readers[name])


@pytest.mark.filterwarnings("error")
@settings(deadline=None, max_examples=8)
@given(name=st.sampled_from(FILES), damage=mutations)
def test_readers_of_a_damaged_dataset_raise_only_errors_of_throwcollect(
    small: Path, name: str, damage: list[Mutation]
) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        directory = Path(shutil.copytree(small, Path(scratch) / "dataset"))
        (directory / name).write_bytes(mutate((small / name).read_bytes(), damage))
        for call in outcomes(directory, name):
            harmless(call)


def test_small_files_that_announce_huge_contents_need_little_memory(small: Path, tmp_path: Path) -> None:
    """The readers run in a process that may take 3 GB."""
    for name, write in BOMBS.items():
        directory = Path(shutil.copytree(small, tmp_path / name))
        write(directory)
    ran = subprocess.run(
        [sys.executable, "-c", READ_ALL, *(str(tmp_path / name) for name in BOMBS)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.stderr == ""
    assert ran.stdout.split() == [f"{name}:refused" for name in BOMBS]


READ_ALL = """
import resource, sys
from pathlib import Path
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throws_table import read_throws
from throwcollect.dataset.verify import verify
from throwcollect.errors import ThrowcollectError
resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))
for name in sys.argv[1:]:
    directory = Path(name)
    assert verify(directory)
    try:
        for episode in Dataset.open(directory).episodes():
            episode.samples()
        print(f"{directory.name}:read")
    except ThrowcollectError:
        print(f"{directory.name}:refused")
"""


def _chunk_announcing(directory: Path, size: int, data: bytes) -> None:
    path = directory / RECORDING
    with open_mcap(path) as contents:
        offset = pq.read_table(directory / "throws.parquet")["chunk_offset"].to_pylist()[0]
        chunk = contents.chunk(offset)
        whole = contents.slice(0, len(contents))
    bomb = Chunk(data, size, 0, chunk.start_ns, chunk.end_ns).record()
    path.write_bytes(whole[:offset] + bomb + whole[offset + chunk.record_size :])


def zstd_bomb(directory: Path) -> None:
    size = 1 << 30
    compressor = zstandard.ZstdCompressor(level=1).compressobj(size=size)
    data = b"".join(compressor.compress(bytes(1 << 26)) for _ in range(size >> 26)) + compressor.flush()
    _chunk_announcing(directory, size, data)


def yaml_aliases(directory: Path) -> None:
    # A merge copies what it names.
    lines = ["a0: &a0 {x: 1}", *(f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 9)}]}}" for n in range(1, 12))]
    (directory / "metadata.yaml").write_text("\n".join([*lines, "rosbag2_bagfile_information: {version: *a11}"]))


BOMBS: dict[str, Callable[[Path], None]] = {"chunk": zstd_bomb, "yaml": yaml_aliases}
