from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from throwcollect.dataset.manifest import Finding
from throwcollect.errors import ConfigError, DatasetError, ForeignPlanError, Problem, RequestError, ThrowcollectError
from throwcollect.extras import MissingExtraError


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


@pytest.mark.parametrize(
    "error",
    [
        MissingExtraError("pinocchio"),
        RequestError("NAME_INVALID", "no such name", expected="another", hint="try it"),
        ForeignPlanError("differs", path=Path("a"), place="trial 3", evidence="6"),
        ConfigError([Problem("is missing", "a.b")], expected="a number"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_of_another_process_arrives_with_all_its_facts(error: ThrowcollectError) -> None:
    arrived = pickle.loads(pickle.dumps(error))  # noqa: S301
    assert (type(arrived), str(arrived), vars(arrived)) == (type(error), str(error), vars(error))
