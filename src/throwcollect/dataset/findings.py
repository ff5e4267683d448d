"""Findings: single things that are wrong with a dataset."""

from __future__ import annotations

from dataclasses import dataclass

from throwcollect.errors import DatasetError


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a file in the dataset's directory.

    Its place there is a trial, a byte or a field; it is empty if the problem is with the file as a whole.
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
