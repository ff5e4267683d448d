from __future__ import annotations

from pathlib import Path

from throwcollect.dataset.findings import Finding
from throwcollect.errors import ConfigError, DatasetError, ForeignPlanError


def test_a_dataset_error_has_its_facts_as_fields_and_in_its_message() -> None:
    error = DatasetError("a chunk is cut off", path=Path("a/b.mcap"), place="byte 17", expected="90 bytes")
    assert (error.path, error.place, error.problem) == (Path("a/b.mcap"), "byte 17", "a chunk is cut off")
    assert str(error) == "a/b.mcap: byte 17: a chunk is cut off\n  expected: 90 bytes"
    assert error.details == "a chunk is cut off\n  expected: 90 bytes"
    assert str(Finding.of("b.mcap", error)) == "b.mcap: byte 17: a chunk is cut off\n  expected: 90 bytes"


def test_locate_adds_the_place_to_an_error_and_keeps_its_type_and_facts() -> None:
    inner = ForeignPlanError("chunk: its CRC differs", place="byte 9", expected="5", evidence="6", hint="copy it again")
    outer = inner.locate(Path("x.mcap"), "trial 4")
    assert type(outer) is ForeignPlanError
    assert outer.message == "x.mcap: trial 4: byte 9: chunk: its CRC differs"
    assert (outer.expected, outer.evidence, outer.hint) == ("5", "6", "copy it again")
    assert outer.locate(place="shard 1").path == Path("x.mcap")


def test_an_error_has_its_message_and_its_hint_in_one_line() -> None:
    assert ConfigError("is missing", expected="a file", hint="write it").one_line == "is missing; try: write it"
    assert ConfigError("is missing").one_line == "is missing"
