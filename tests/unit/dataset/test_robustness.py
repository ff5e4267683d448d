"""No damage makes a reader crash, hang or fill the memory: it reads, or raises an error of throwcollect."""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow as pa
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
from throwcollect.dataset.verify import verify
from throwcollect.episode.chunk import Chunk
from throwcollect.episode.episode_message import header_from_json
from throwcollect.errors import DatasetError, ThrowcollectError
from throwcollect.sweep.plan import Plan

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
                    harmless(lambda offset=record.offset: contents.episode(contents.record(offset)).episode.samples())

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


@pytest.mark.parametrize(
    "header",
    [
        '{"trial":0,"start_ns":0,"end_reason":"x","contacts":[],"goals":[],"samples":' + "9" * 30 + "}",
        '{"trial":0,"start_ns":' + "9" * 400 + ',"end_reason":"x","contacts":[],"goals":[],"samples":1}',
        '{"trial":0,"start_ns":-1,"end_reason":"x","contacts":[],"goals":[],"samples":1}',
        '{"trial":0,"start_ns":0,"end_reason":"x","contacts":[{"body":"spoon","start_ns":0,"end_ns":'
        + "9" * 25
        + '}],"goals":[],"samples":1}',
        "[" * 100_000,
    ],
)
def test_episode_headers_with_impossible_numbers_are_refused(header: str) -> None:
    with pytest.raises(DatasetError, match=r"^episode header: "):
        header_from_json(header)


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
    # Episodes are found by their offsets in the table, so a wrong length before them does no harm.
    readable = {"record_length"}
    assert ran.stdout.split() == [f"{name}:{'read' if name in readable else 'refused'}" for name in BOMBS]


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
        stored = contents.episode(contents.record(offset))
        whole = contents.slice(0, len(contents))
    bomb = Chunk(data, size, 0, stored.episode.chunk.start_ns, stored.episode.chunk.end_ns).record()
    path.write_bytes(whole[:offset] + bomb + whole[stored.chunk.end :])


def zstd_bomb(directory: Path) -> None:
    size = 1 << 30
    compressor = zstandard.ZstdCompressor(level=1).compressobj(size=size)
    data = b"".join(compressor.compress(bytes(1 << 26)) for _ in range(size >> 26)) + compressor.flush()
    _chunk_announcing(directory, size, data)


def zstd_announcing(directory: Path) -> None:
    """A frame header that announces 2^62 bytes."""
    _chunk_announcing(directory, 1 << 62, struct.pack("<IBQ", 0xFD2FB528, 0xE0, 1 << 62) + b"\x01\x00\x00")


def record_length(directory: Path) -> None:
    data = bytearray((directory / RECORDING).read_bytes())
    struct.pack_into("<Q", data, 9, 2**63)
    (directory / RECORDING).write_bytes(data)


def yaml_aliases(directory: Path) -> None:
    lines = ["a0: &a0 [x, x]", *(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 12))]
    (directory / "metadata.yaml").write_text("\n".join([*lines, "rosbag2_bagfile_information: {version: *a11}"]))


def yaml_depth(directory: Path) -> None:
    (directory / "metadata.yaml").write_text("rosbag2_bagfile_information: " + "[" * 600)


def config_aliases(directory: Path) -> None:
    lines = ["a0: &a0 [x, x]", *(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 12))]
    (directory / "config.yaml").write_text("\n".join(lines))


def text_that_is_none(directory: Path) -> None:
    path = directory / "throws.parquet"
    table = pq.read_table(path)
    index = table.schema.get_field_index("outcome")
    bad = pa.array([b"\xff\xfe"] * len(table)).view(pa.string())
    pq.write_table(table.set_column(index, table.schema.field(index), bad), path)


BOMBS: dict[str, Callable[[Path], None]] = {
    write.__name__: write
    for write in (
        zstd_bomb, zstd_announcing, record_length, yaml_aliases, yaml_depth, config_aliases, text_that_is_none,
    )
}  # fmt: skip


def test_a_table_that_announces_more_rows_than_any_dataset_has_is_refused(small: Path, tmp_path: Path) -> None:
    directory = Path(shutil.copytree(small, tmp_path / "dataset"))
    pq.write_table(pa.table({"trial": pa.nulls(30_000_000, pa.int8())}), directory / "throws.parquet")
    assert "announces 30000000 rows" in "\n".join(map(str, verify(directory)))
