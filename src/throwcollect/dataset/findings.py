"""Findings: single things that are wrong with a dataset."""

from __future__ import annotations

from dataclasses import dataclass

from throwcollect.errors import DatasetError


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Attributes:
        file: Name of the file in the dataset's directory.
        place: The place in it: a trial, a byte, a field; empty if it is the file as a whole.
        problem: What is wrong.
    """

    file: str
    place: str
    problem: str

    @classmethod
    def of(cls, file: str, error: DatasetError) -> Finding:
        """Make a finding of an error in the file of this name in the dataset's directory."""
        return cls(file, error.place, error.details)

    def __str__(self) -> str:
        return ": ".join(part for part in (self.file, self.place, self.problem) if part)
