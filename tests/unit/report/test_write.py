from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib.image as image
import pytest
from tests.unit.report.page_parser import Page
from tests.unit.report.test_page import SECTIONS
from typer.testing import CliRunner

from throwcollect.cli.main import dataset_app
from throwcollect.dataset.directory import METADATA
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.extras import MissingExtraError
from throwcollect.report.write import write_report


@pytest.fixture(autouse=True, scope="module")
def _coarse_pictures() -> Iterator[None]:
    """Pictures of fewer pixels, which are drawn in less time; `test_pictures.py` draws those that are printed."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("throwcollect.report.painter.DPI", 50)
        yield


@pytest.mark.parametrize(
    ("settings", "refused", "lost"),
    [
        ({"sweep": {"sampler": "grid", "parameters": {"task.duration_s": {"values": [1.0]}}}}, [], []),
        ({"trials": 1}, [], [0]),
        ({"trials": 4}, [0, 1, 3], []),
    ],
    ids=["a single throw", "no landing", "all refused but one"],
)
def test_the_report_of_a_dataset_with_few_throws_has_every_section(
    make_collection: Any,
    tmp_path: Path,
    settings: dict[str, Any],
    refused: list[int],
    lost: list[int],
) -> None:
    collection = make_collection({"trials": None, **settings})
    for trial in refused:
        collection.refuse(trial, "too fast")
    trials = [trial.number for trial in collection.plan.trials if trial.number not in refused]
    directory = collection.collect(tmp_path / "dataset", trials, lost=lost)
    written = write_report(directory, tmp_path / "page.html", pictures=tmp_path / "pictures")
    page = Page(written.page.read_text(encoding="utf-8"))
    assert [attributes["id"] for attributes in page.find_elements("section")] == SECTIONS
    assert ("No ball crossed the landing plane." in page.words) == bool(lost)
    assert "This dataset has no journal of its collection" in page.words
    assert len(written.pictures) == (2 if lost else 9)
    for picture in written.pictures:
        assert image.imread(picture)[..., :3].min() < 0.9, picture.name


def test_a_report_of_an_unfinished_dataset_is_refused_and_writes_nothing(dataset: Path, tmp_path: Path) -> None:
    (dataset / METADATA).unlink()
    with pytest.raises(DatasetError, match=r"not finished|unfinished"):
        write_report(dataset, tmp_path / "page.html", pictures=tmp_path / "pictures")
    assert [path.name for path in tmp_path.iterdir()] == ["dataset"]


def test_a_report_never_overwrites_existing_files(collected: Path, tmp_path: Path) -> None:
    page, pictures = tmp_path / "page.html", tmp_path / "pictures"
    page.write_text("mine")
    with pytest.raises(ConfigError, match=r"page\.html: exists"):
        write_report(collected, page)
    assert page.read_text() == "mine"
    pictures.mkdir()
    (pictures / "mine.png").write_text("mine")
    with pytest.raises(ConfigError, match="pictures: exists"):
        write_report(collected, tmp_path / "other.html", pictures=pictures)
    assert not (tmp_path / "other.html").exists()


def test_a_report_without_plotly_says_what_to_install(
    collected: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "plotly", None)
    with pytest.raises(MissingExtraError, match="needs plotly, which is not installed") as raised:
        write_report(collected, tmp_path / "page.html", pictures=tmp_path / "pictures")
    assert raised.value.hint == "pip install 'throwcollect[report]'"


def test_the_report_command_writes_beside_the_dataset_and_prints_a_summary(dataset: Path, tmp_path: Path) -> None:
    printed = CliRunner().invoke(dataset_app, ["report", str(dataset), "--json"])
    assert printed.exit_code == 0, printed.output
    found = json.loads(printed.output)
    assert found["page"] == str(tmp_path / "dataset.html")
    assert found["size_bytes"] == (tmp_path / "dataset.html").stat().st_size
    assert found["pictures"] == []
    named = CliRunner().invoke(dataset_app, ["report", str(dataset), "-o", str(tmp_path / "named.html")])
    assert named.exit_code == 0, named.output
    assert (tmp_path / "named.html").read_bytes() == (tmp_path / "dataset.html").read_bytes()
