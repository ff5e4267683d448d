"""The manifest covers every promised byte, and every command that writes a dataset writes it."""

from __future__ import annotations

import json
import os
import random
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.opcode import Opcode
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.damage import records_of
from tests.unit.dataset.mutations import SETTINGS, finish

from throwcollect.dataset.derive.derivation import filter_trials
from throwcollect.dataset.manifest import entry_of_file, find_changed_files, list_promised_names, read_manifest
from throwcollect.dataset.mcap_reader import open_mcap
from throwcollect.dataset.verify import find_damage, verify
from throwcollect.errors import DatasetError

MANIFEST = "datapackage.json"
TABLES = ["config.yaml", "metadata.yaml", "plan.parquet", "throws.parquet"]
SHARDS = [f"quick_{number:05d}.mcap" for number in range(3)]
FLIPS_PER_CLASS = 10


@pytest.fixture(scope="module")
def derived(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small dataset with every kind of file."""
    scratch = tmp_path_factory.mktemp("derived")
    filter_trials(Collection(SETTINGS).collect(scratch / "source"), scratch / "dataset", where="trial >= 0")
    return scratch / "dataset"


def classes(directory: Path) -> Iterator[tuple[str, str, list[range]]]:
    """Name, file and byte ranges of each class of bytes that a flip may hit."""
    for name in (*list_promised_names(directory), MANIFEST):
        if not name.endswith(".mcap"):
            yield name, name, [range((directory / name).stat().st_size)]
    shard = next(name for name in list_promised_names(directory) if name.endswith(".mcap"))
    size = (directory / shard).stat().st_size
    kinds: dict[str, list[range]] = {"magic": [range(8), range(size - 8, size)]}
    with open_mcap(directory / shard) as contents:
        for record in records_of(contents):
            kinds.setdefault(Opcode(record.opcode).name, []).append(range(record.offset, record.end))
    yield from ((f"MCAP {kind}", shard, places) for kind, places in kinds.items())


def flip_bit(data: bytes, byte: int, bit: int) -> bytes:
    changed = bytearray(data)
    changed[byte] ^= 1 << bit
    return bytes(changed)


def test_a_flipped_bit_in_any_file_is_found(derived: Path, tmp_path: Path) -> None:
    directory = Path(shutil.copytree(derived, tmp_path / "dataset"))
    assert verify(directory) == []
    source, flips, kinds = random.Random(0), 0, list(classes(directory))
    for kind, name, places in kinds:
        whole = (directory / name).read_bytes()
        for number in range(FLIPS_PER_CLASS):
            byte = source.choice(source.choice(places))
            (directory / name).write_bytes(flip_bit(whole, byte, source.randrange(8)))
            flips += 1
            assert any(find_damage(directory, in_full=True)), (kind, byte)
            if not number:
                assert verify(directory), (kind, byte)
        (directory / name).write_bytes(whole)
    assert {"MCAP CHUNK", "MCAP MESSAGE_INDEX", "MCAP METADATA", "MCAP FOOTER"} <= {kind for kind, _, _ in kinds}
    assert flips >= 200
    assert verify(directory) == []


def test_the_manifest_lists_the_promised_files_and_no_others(dataset: Path) -> None:
    entries = read_manifest(dataset)
    assert [entry.path for entry in entries] == sorted([*TABLES, *SHARDS])
    assert list(entries) == [entry_of_file(dataset / entry.path) for entry in entries]
    document = json.loads((dataset / MANIFEST).read_text())
    assert document["profile"] == "data-package"
    assert document["resources"][0]["hash"].startswith("sha256:")


def test_a_missing_manifest_is_reported_and_resume_writes_it(dataset: Path) -> None:
    written = (dataset / MANIFEST).read_bytes()
    (dataset / MANIFEST).unlink()
    (finding,) = verify(dataset)
    assert finding.file == MANIFEST
    with pytest.raises(DatasetError, match=f"{MANIFEST}: is missing"):
        read_manifest(dataset)
    finish(dataset)
    assert (dataset / MANIFEST).read_bytes() == written


def find_resized(directory: Path) -> list[str]:
    return [finding.file for finding in find_changed_files(directory, read_manifest(directory), in_full=False)]


def test_the_quick_check_finds_shortened_and_missing_files(dataset: Path) -> None:
    assert find_resized(dataset) == []
    os.truncate(dataset / SHARDS[0], 100)
    (dataset / SHARDS[1]).unlink()
    (dataset / "sources.parquet").write_bytes(b"")
    assert find_resized(dataset) == [SHARDS[0], SHARDS[1]]
    assert "sources.parquet" in {finding.file for finding in find_damage(dataset, in_full=True)}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("path", "../metadata.yaml"),
        ("path", "/etc/passwd"),
        ("bytes", 1.0),
        ("hash", "sha256:0"),
    ],
)
def test_a_manifest_entry_with_an_invalid_path_size_or_hash_is_refused(dataset: Path, key: str, value: Any) -> None:
    document = json.loads((dataset / MANIFEST).read_text())
    document["resources"][0][key] = value
    (dataset / MANIFEST).write_text(json.dumps(document, indent=2) + "\n")
    with pytest.raises(DatasetError, match=MANIFEST):
        read_manifest(dataset)
