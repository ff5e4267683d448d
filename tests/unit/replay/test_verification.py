"""The arguments of the check of a dataset."""

from __future__ import annotations

from pathlib import Path

import pytest

from throwcollect.errors import ConfigError
from throwcollect.replay.verification import verify_dataset


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"replay": -1}, "replay: got -1\n  expected: 0 or more"),
        ({"replay": 1.5}, r"replay: got 1\.5\n  expected: a whole number, 0 or more"),
        ({"processes": 0}, "processes: got 0\n  expected: 1 or more"),
    ],
)
def test_verify_refuses_wrong_numbers_of_throws_and_processes(dataset: Path, arguments, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^{message}$"):
        verify_dataset(dataset, **arguments)
