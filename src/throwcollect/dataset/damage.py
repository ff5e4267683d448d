"""Says in which dataset and trial damage is that is found only when an episode is read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from throwcollect.dataset.reader import Dataset
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import DatasetError
from throwcollect.wording import command


@contextmanager
def locating_damage(dataset: Dataset, trial: int) -> Iterator[None]:
    """Add the dataset, the trial and a command that finds more to an error that an episode raises without them."""
    try:
        yield
    except DatasetError as error:
        if error.path is not None:
            raise
        located = error.locate(dataset.directory, f"trial {trial}")
        located.hint = located.hint or command("dataset", "verify", dataset.directory)
        raise located from error


def read_samples(dataset: Dataset, trial: int) -> tuple[EpisodeHeader, Samples]:
    """Read header and samples of a trial's episode."""
    with locating_damage(dataset, trial):
        episode = dataset.episode(trial)
        return episode.header, episode.samples(dataset.joints)
