"""The section of a report on targets."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.targeted import collect_targeted

from throwcollect.dataset.reader import Dataset
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.publish.report.sections import report_dataset
from throwcollect.publish.report.targets import choose_scale, show_targets


def hold_ball(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    return samples, replace(header, end_reason="timeout", contacts=(replace(header.contacts[0], end_ns=None),))


def test_the_section_shows_targets_misses_and_their_spread(tmp_path: Path) -> None:
    dataset = Dataset.open(collect_targeted(tmp_path / "data"))
    misses = sorted(throw.miss_m for throw in dataset if throw.miss_m is not None)
    (section,) = show_targets(dataset)
    assert section.text == "3 of 4 throws should end at a target."
    assert section.blocks[1].rows[0][3] == f"{100 * misses[1]:.2f} cm"
    (above,) = section.blocks[0]
    others, targets, lines = above.figure.data
    assert (len(others.x), sorted(targets.x)) == (1, [1.4, 1.5, 1.6])
    ends = np.array(lines.x, np.float64)[1::3], np.array(lines.y, np.float64)[1::3]
    thrown = [throw for throw in dataset if throw.target]
    assert np.allclose(ends[0], [throw.row["landing_x_m"] for throw in thrown])
    assert "misses" in [each.key for each in report_dataset(dataset).sections]


def test_a_dataset_without_targets_has_no_section_but_one_without_misses_has(tmp_path: Path) -> None:
    assert show_targets(Dataset.open(Collection().collect(tmp_path / "plain"))) == ()
    (section,) = show_targets(Dataset.open(collect_targeted(tmp_path / "held", change=hold_ball)))
    assert section.text == "3 of 4 throws should end at a target."
    (above,) = section.blocks[0]
    assert [trace.name for trace in above.figure.data] == ["throws of the dataset", "targets where no throw landed"]


@pytest.mark.parametrize(
    ("miss", "times"), [(0.4, 1), (0.01, 10), (0.0049, 100), (3e-5, 10_000), (1e-9, 10_000), (0, 1)]
)
def test_misses_are_magnified_as_far_as_the_distance_of_targets_allows(miss: float, times: int) -> None:
    targets = np.array([[1.0, 0.0], [1.5, 0.2]])
    assert choose_scale(targets, targets + np.array([miss, 0.0])) == times
    assert choose_scale(targets[:0], targets[:0]) == 1
    third = np.array([miss, 0.0, 5.0])
    assert choose_scale(np.eye(2, 3), np.eye(2, 3) + third) == choose_scale(np.eye(2), np.eye(2) + third[:2])
