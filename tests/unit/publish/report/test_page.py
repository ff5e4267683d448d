"""The page of a report: its sections, and text that is never markup."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
import pytest
from plotly.offline import get_plotlyjs
from tests.unit.publish.report.page_parser import Page

from throwcollect.dataset.directory import METADATA
from throwcollect.dataset.provenance import read_provenance, write_provenance
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.publish.report.contents import Panel, ReportSection, Table
from throwcollect.publish.report.measured import Outcomes
from throwcollect.publish.report.sections import Report, render_page, report_dataset, write_report

SECTIONS = [
    "landing",
    "release",
    "physics",
    "parameters",
    "outcomes",
    "limits",
    "throughput",
    "provenance",
]


def parse(directory: Path) -> Page:
    return Page(render_page(report_dataset(Dataset.open(directory))))


@pytest.fixture(scope="module")
def text(collected: Path) -> str:
    return render_page(report_dataset(Dataset.open(collected)))


def test_a_page_has_every_section_and_a_drawing_place_for_every_plot(text: str) -> None:
    page = Page(text)
    assert [attributes["id"] for attributes in page.find_elements("section")] == SECTIONS
    assert [attributes["href"] for attributes in page.find_elements("a")] == [f"#{name}" for name in SECTIONS]
    places = [attributes["id"] for attributes in page.find_elements("div") if attributes.get("class") == "plot"]
    assert places == list(page.plots)
    assert {name.partition("-")[0] for name in places} >= {"landing", "release", "limits"}
    for name, plot in page.plots.items():
        assert plot["data"], name
        axes = [axis for key, axis in plot["layout"].items() if re.fullmatch(r"[xy]axis\d*", key)]
        titled = [axis for axis in axes if axis.get("title")]
        assert titled, name
        for axis in titled:
            assert re.search(r"\[.+\]$|^flights$|^throws$|^share of trials$", axis["title"]["text"]), axis


def test_a_page_loads_nothing_from_other_addresses(text: str) -> None:
    page = Page(text)
    assert not [attributes for tag, attributes in page.elements if "src" in attributes]
    assert [attributes["href"] for attributes in page.find_elements("link")] == ["data:,"]
    assert text.count(get_plotlyjs()) == 1
    assert not re.search(r"\w+://|url\(|@import", text.replace(get_plotlyjs(), ""))
    assert "default-src 'none'" in text
    assert len(text) < 7_000_000


def test_text_of_a_dataset_is_never_interpreted_as_markup(collection: Any, tmp_path: Path) -> None:
    hostile = "</script><script>alert('$x')</script> & <b>"
    collection.refuse(4, hostile)
    directory = collection.collect(tmp_path / "dataset", [0, 1, 2, 3, 5, 6])
    collected = read_provenance(directory)
    assert collected is not None
    write_provenance(directory, replace(collected, host="<img src=x onerror=alert(1)>"))
    page = parse(directory)
    assert len(page.find_elements("script")) == len(page.plots) + 2
    assert not page.find_elements("img")
    assert ("td", hostile) in page.texts
    assert ("code", "<img src=x onerror=alert(1)>") in page.texts


def test_hostile_text_of_a_report_is_escaped_in_scripts_and_attributes() -> None:
    hostile = """a"></div>'</script ><b>"""
    figure = go.Figure(layout_title=hostile, layout_height=100).add_scatter(x=[1], y=[2])
    table = Table(rows=((hostile, hostile),))
    blocks = ((Panel("key", hostile, figure, hostile),), table, hostile)
    text = render_page(
        Report(hostile, hostile, (), Outcomes.of([hostile]), (ReportSection("one", hostile, hostile, blocks),))
    )
    assert "</script " not in text
    page = Page(text)
    assert page.plots["one-key"]["layout"]["title"]["text"] == hostile
    assert [
        attributes["aria-label"] for attributes in page.find_elements("div") if attributes.get("class") == "plot"
    ] == [hostile]
    assert not page.find_elements("b")
    assert {tag for tag, said in page.texts if said == hostile} == {"h1", "h2", "h3", "p", "th", "td"}


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
    page = parse(collection.collect(tmp_path / "dataset", trials, lost=lost))
    assert [attributes["id"] for attributes in page.find_elements("section")] == SECTIONS
    assert ("No ball crossed the landing plane." in page.words) == bool(lost)
    assert "This dataset has no journal of its collection" in page.words


def test_a_report_never_overwrites_a_file_and_writes_nothing_of_an_unfinished_dataset(
    dataset: Path, tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    page.write_text("mine")
    with pytest.raises(ConfigError, match=r"page\.html: exists"):
        write_report(dataset, page)
    assert page.read_text() == "mine"
    page.unlink()
    (dataset / METADATA).unlink()
    with pytest.raises(DatasetError, match="not finished"):
        write_report(dataset, page)
    assert [path.name for path in tmp_path.iterdir()] == ["dataset"]
