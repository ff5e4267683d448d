from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from ruamel.yaml import YAML

import throwcollect
from throwcollect.config.loader import load
from throwcollect.dataset.card import Provenance, data_card


def test_the_card_has_the_header_that_hubs_read(dataset: Path) -> None:
    _, header, text = (dataset / "README.md").read_text().split("---\n", 2)
    fields = YAML(typ="safe").load(header)
    assert fields["task_categories"] == ["robotics"]
    assert fields["configs"] == [{"config_name": "throws", "data_files": "throws.parquet"}]
    assert fields["size_categories"] == ["n<1K"]
    assert "| landed | 7 |" in text
    assert "| `task.duration_s` | " in text


def test_the_card_says_how_the_collection_was_run(dataset: Path) -> None:
    text = (dataset / "README.md").read_text()
    for fact in (
        f"| throwcollect | {throwcollect.__version__} |",
        "| simulations | 2 |",
        "| wall time | 1.5 s |",
        "| host | ",
    ):
        assert fact in text


def test_trials_without_an_episode_are_no_throws(dataset: Path) -> None:
    throws = pq.read_table(dataset / "throws.parquet")
    column = throws.schema.get_field_index("digest")
    fewer = throws.set_column(column, "digest", pa.array([None, None, *throws["digest"].to_pylist()[2:]]))
    provenance = Provenance.of_this_machine(simulations=1, wall_s=1.0, was_open=False)
    assert "\n5 simulated throws of a ball" in data_card(load(dataset / "config.yaml"), fewer, provenance)
