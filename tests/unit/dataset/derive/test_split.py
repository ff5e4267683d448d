import math
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from tests.unit.dataset.conftest import Collection, create_and_open

from throwcollect.dataset.derive.derivation import merge
from throwcollect.dataset.derive.split import assign, split
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.verify import verify
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.errors import ConfigError

HALVES = "train=0.5,test=0.5"


def hold_ball(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    return samples, replace(header, contacts=(Contact("spoon", header.start_ns, None),))


WIDE_M = 0.2
"""Squares that are wide enough for several throws."""


@pytest.fixture(autouse=True)
def _wide_squares(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("throwcollect.dataset.derive.split.SQUARE_M", WIDE_M)


def squares(directory: Path) -> list[tuple[int, int] | None]:
    rows = Dataset.open(directory).throws.select(["landing_x_m", "landing_y_m"]).to_pylist()
    return [None if None in row.values() else tuple(math.floor(part / WIDE_M) for part in row.values()) for row in rows]


def train(directory: Path, *, seed: int, fractions: str = HALVES) -> list[int]:
    """The trials of the part of this name."""
    return assign(Dataset.open(directory), fractions=fractions, seed=seed)["train"]


@pytest.fixture(scope="module")
def some(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve throws, the last four of which do not land."""
    collection = Collection({"trials": 12})
    directory = tmp_path_factory.mktemp("split") / "some"
    writer = create_and_open(directory, collection.plan)
    collection.fill(writer, range(8))
    collection.fill(writer, range(8, 12), change=hold_ball)
    writer.finish()
    writer.close()
    return directory


def test_the_parts_of_a_split_are_datasets_that_share_no_square(some: Path, tmp_path: Path) -> None:
    found = split(some, tmp_path / "parts", fractions=HALVES, seed=1)
    held, trials = {}, []
    for name, part in found.items():
        directory = tmp_path / "parts" / name
        # No physics holds the ball as `held` does; everything else has to fit.
        assert [finding for finding in verify(directory) if not finding.place.startswith("trial ")] == []
        dataset = Dataset.open(directory)
        held[name] = set(squares(directory)) - {None}
        assert part.trials == len(dataset)
        trials += pq.read_table(directory / "sources.parquet")["source_trial"].to_pylist()
    assert not held["train"] & held["test"]
    assert len(set(squares(some))) < len(trials)
    assert sorted(trials) == list(range(12))


def test_adding_trials_moves_no_trial_from_one_part_of_a_split_to_another(some: Path, tmp_path: Path) -> None:
    other = Collection({"seed": 1}).collect(tmp_path / "other")
    merge([other, some], tmp_path / "more")
    shift = len(Dataset.open(other))
    for seed in range(6):
        before = train(some, seed=seed)
        after = [number - shift for number in train(tmp_path / "more", seed=seed)]
        assert before == [number for number in after if number >= 0]


def test_adding_a_part_takes_trials_only_from_the_part_that_shrinks(some: Path) -> None:
    assert train(some, seed=2, fractions="train=1/2,val=1/4,test=1/4") == train(some, seed=2)


def test_the_seed_decides_which_part_a_trial_belongs_to(some: Path) -> None:
    assert train(some, seed=1) == train(some, seed=1) != train(some, seed=2)


@pytest.mark.parametrize(
    ("fractions", "message"),
    [
        ("train=0.8,test=0.1", "should be shares above 0 of two parts or more, which add up to 1"),
        ("train=0.5,test", r"got 'train=0.5,test'\n.*names and shares: train=0.8,test=0.2"),
    ],
)
def test_a_split_by_wrong_fractions_is_refused_with_a_reason(
    some: Path, tmp_path: Path, fractions: str, message: str
) -> None:
    with pytest.raises(ConfigError, match=f"^fractions: .*{message}"):
        split(some, tmp_path / "parts", fractions=fractions)
    assert not list(tmp_path.iterdir())


def test_shares_can_be_given_as_a_mapping(some: Path) -> None:
    assert train(some, seed=1, fractions={"train": 0.8, "test": 0.2}) == train(
        some, seed=1, fractions="train=0.8,test=0.2"
    )
    thirds = train(some, seed=1, fractions={"train": 1 / 3, "test": 2 / 3})
    assert thirds == train(some, seed=1, fractions="train=1/3,test=2/3")
