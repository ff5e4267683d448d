from __future__ import annotations

from pathlib import Path

from ruamel.yaml import YAML

import throwcollect


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
