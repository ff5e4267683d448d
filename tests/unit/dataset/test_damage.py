"""Every reader of a damaged episode names its dataset and trial, and the command that finds all damage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from tests.unit.dataset.damage import SHARD, find_stored, flip

from throwcollect.dataset.derive.derivation import merge
from throwcollect.dataset.derive.statistics import statistics
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import DatasetError
from throwcollect.publish.export.export import export
from throwcollect.publish.report.sections import report_dataset
from throwcollect.publish.view.animation import render
from throwcollect.publish.view.viewer_directory import view
from throwcollect.replay import replay_throws

READERS: dict[str, Callable[[Path], object]] = {
    "statistics": statistics,
    "merge": lambda dataset: merge([dataset], dataset / "merged"),
    "export": lambda dataset: export(dataset, dataset / "npz", to="npz"),
    "view": lambda dataset: view(dataset, dataset / "view"),
    "render": lambda dataset: render(dataset, dataset / "throw.png", trials=[4]),
    "report": lambda dataset: report_dataset(Dataset.open(dataset)),
    "replay": lambda dataset: list(replay_throws(dataset, [4])),
}


@pytest.mark.parametrize("reader", READERS)
def test_readers_of_a_damaged_episode_name_the_dataset_and_the_trial(reader: str, dataset: Path) -> None:
    flip(dataset / SHARD, find_stored(dataset / SHARD, 4).run.offset + 2000)
    with pytest.raises(DatasetError, match=rf"^{dataset}: trial 4: chunk: ") as found:
        READERS[reader](dataset)
    assert found.value.hint == f"throwcollect dataset verify {dataset}"
