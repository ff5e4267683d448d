"""The manifest covers every promised byte, and every command that writes a dataset writes it."""

from __future__ import annotations

import hashlib
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

from throwcollect.dataset.manifest import (
    RunningHash,
    entry_of_file,
    find_changed_files,
    list_promised_names,
    read_manifest,
)
from throwcollect.dataset.mcap_reader import open_mcap
from throwcollect.dataset.verify import find_damage, verify
from throwcollect.derive.derivation import filter_trials
from throwcollect.errors import DatasetError

MANIFEST = "datapackage.json"
TABLES = ["config.yaml", "metadata.yaml", "plan.parquet", "throws.parquet"]
SHARDS = [f"quick_{number:05d}.mcap" for number in range(3)]
FLIPS_PER_CLASS = 20


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
    assert flips >= 400
    assert verify(directory) == []


def test_a_flipped_bit_in_the_footer_of_a_table_is_found_in_that_file(dataset: Path) -> None:
    """Only the hash of the file shows such a flip, as readers of the columns do not use these bytes."""
    for name in ("plan.parquet", "throws.parquet"):
        path = dataset / name
        whole = path.read_bytes()
        path.write_bytes(flip_bit(whole, whole.index(b"parquet-cpp-arrow") + 3, 0))
        assert any(finding.file == name and "SHA-256" in finding.problem for finding in verify(dataset))
        path.write_bytes(whole)


def test_the_manifest_lists_the_promised_files_and_no_others(dataset: Path) -> None:
    entries = read_manifest(dataset)
    assert [entry.path for entry in entries] == sorted([*TABLES, *SHARDS])
    assert list(entries) == [entry_of_file(dataset / entry.path) for entry in entries]
    document = json.loads((dataset / MANIFEST).read_text())
    assert document["profile"] == "data-package"
    assert document["resources"][0]["hash"].startswith("sha256:")


def test_filter_writes_the_manifest_of_its_output(derived: Path) -> None:
    assert [entry.path for entry in read_manifest(derived)] == list_promised_names(derived)
    assert {"sources.parquet", "trials.parquet"} < set(list_promised_names(derived))


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
    "text",
    [
        "",
        "[1]",
        '{"name": "quick", "resources": [{}]}',
        '{"name": "quick", "resources": {}}',
        '{"name": "quick", "resources": [1]}',
        "[" * 100_000,
    ],
)
def test_a_malformed_manifest_is_refused(dataset: Path, text: str) -> None:
    (dataset / MANIFEST).write_text(text)
    with pytest.raises(DatasetError, match=MANIFEST):
        read_manifest(dataset)
    assert [finding.file for finding in verify(dataset)] == [MANIFEST]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("path", "../metadata.yaml"),
        ("path", "/etc/passwd"),
        ("path", "\ud800"),
        ("bytes", True),
        ("bytes", 1.0),
        ("hash", "sha256:0"),
        ("hash", "0" * 64),
    ],
)
def test_a_manifest_entry_with_an_invalid_path_size_or_hash_is_refused(dataset: Path, key: str, value: Any) -> None:
    document = json.loads((dataset / MANIFEST).read_text())
    document["resources"][0][key] = value
    (dataset / MANIFEST).write_text(json.dumps(document, indent=2) + "\n")
    with pytest.raises(DatasetError, match=MANIFEST):
        read_manifest(dataset)


def test_a_running_hash_is_that_of_all_bytes_in_order() -> None:
    source = random.Random(0)
    parts = [source.randbytes(source.randrange(400_000)) for _ in range(20)]
    running = RunningHash()
    for part in parts:
        running.update(part)
    assert running.hexdigest() == hashlib.sha256(b"".join(parts)).hexdigest()


def test_a_recording_that_is_a_symbolic_link_is_reported(dataset: Path, tmp_path: Path) -> None:
    (dataset / SHARDS[0]).rename(tmp_path / SHARDS[0])
    (dataset / SHARDS[0]).symlink_to(tmp_path / SHARDS[0])
    assert find_resized(dataset) == [SHARDS[0]]
    assert any("symbolic link" in finding.problem for finding in verify(dataset))
