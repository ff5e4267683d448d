"""What is wrong with a dataset, one thing at a time."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from throwcollect.errors import DatasetError


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Attributes:
        file: Name of the file in the dataset's directory.
        place: Where in it: a trial, a byte, a field; empty when it is the file as a whole.
        problem: What is wrong.
    """

    file: str
    place: str
    problem: str

    @classmethod
    def of(cls, file: str, error: DatasetError) -> Finding:
        """What an error says of a file.

        Args:
            file: Name of the file in the dataset's directory.
            error: The error.
        """
        return cls(file, error.place, error.details)

    def __str__(self) -> str:
        return ": ".join(part for part in (self.file, self.place, self.problem) if part)

    def as_dict(self) -> dict[str, str]:
        """The same for JSON."""
        return asdict(self)
