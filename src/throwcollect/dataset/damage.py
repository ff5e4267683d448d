"""Says where damage is that is only found when an episode is looked at."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from throwcollect.dataset.reader import Dataset
from throwcollect.errors import DatasetError
from throwcollect.wording import command


@contextmanager
def locating_damage(dataset: Dataset, trial: int) -> Iterator[None]:
    """Report damage of an episode, which knows neither its dataset nor its place, with both and a way to find more.

    Raises:
        DatasetError: If the block raises one.
    """
    try:
        yield
    except DatasetError as error:
        if error.path is not None:
            raise
        located = error.locate(dataset.directory, f"trial {trial}")
        located.hint = located.hint or command("dataset", "verify", dataset.directory)
        raise located from error
