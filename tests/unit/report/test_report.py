from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.image as image
import pytest
from plotly.offline import get_plotlyjs
from typer.testing import CliRunner

from throwcollect.cli.dataset.commands import dataset_app
from throwcollect.dataset.directory import CARD, METADATA
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.report.dataset_facts import gather
from throwcollect.report.page import page as html
from throwcollect.report.write import write_report

SECTIONS = [
    "landing",
    "parameters",
    "outcomes",
    "release",
    "limits",
    "throws",
    "physics",
    "throughput",
    "provenance",
]
VOID = {"meta", "link", "br"}


class Page(HTMLParser):
    """What a browser would find in a page; whether its elements are nested well."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append((self.open[-1] if self.open else "", data))

    def named(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]

    @property
    def plots(self) -> dict[str, dict[str, Any]]:
        """Figures by their name; fails where the JSON does."""
        scripts = [attributes for attributes in self.named("script") if attributes.get("type") == "application/json"]
        bodies = [text for tag, text in self.texts if tag == "script" and text.startswith('{"data":')]
        assert len(scripts) == len(bodies)
        return {
            str(attributes["id"]).removesuffix("-data"): json.loads(body)
            for attributes, body in zip(scripts, bodies, strict=True)
        }

    @property
    def words(self) -> str:
        return " ".join(" ".join(text.split()) for tag, text in self.texts if tag not in ("script", "style"))


def report(directory: Path, page: Path) -> Page:
    write_report(directory, page)
    return Page(page.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def written(collected: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("report")
    write_report(collected, directory / "page.html", pictures=directory / "pictures")
    return directory


def test_a_page_has_every_section_and_a_drawing_place_for_every_plot(written: Path) -> None:
    page = Page((written / "page.html").read_text(encoding="utf-8"))
    assert [attributes["id"] for attributes in page.named("section")] == SECTIONS
    assert [attributes["href"] for attributes in page.named("a")] == [f"#{name}" for name in SECTIONS]
    places = [attributes["id"] for attributes in page.named("div") if attributes.get("class") == "plot"]
    assert places == list(page.plots)
    assert {name.partition("-")[0] for name in places} >= {"landing", "parameters", "release", "limits", "throws"}
    for name, plot in page.plots.items():
        assert plot["data"], name
        axes = [axis for key, axis in plot["layout"].items() if re.fullmatch(r"[xy]axis\d*", key)]
        titled = [axis for axis in axes if axis.get("title")]
        assert titled, name
        for axis in titled:
            assert re.search(r"\[.+\]$|^flights$|^throws$|^share of trials$", axis["title"]["text"]), axis


def test_a_page_needs_nothing_from_elsewhere(written: Path) -> None:
    text = (written / "page.html").read_text(encoding="utf-8")
    page = Page(text)
    assert not [attributes for tag, attributes in page.elements if "src" in attributes]
    assert [attributes["href"] for attributes in page.named("link")] == ["data:,"]
    assert text.count(get_plotlyjs()) == 1
    assert not re.search(r"\w+://|url\(|@import", text.replace(get_plotlyjs(), ""))
    assert "default-src 'none'" in text
    assert len(text) < 7_000_000


def test_pictures_are_one_column_wide_in_print_and_not_blank(written: Path) -> None:
    names = {picture.name for picture in (written / "pictures").iterdir()}
    assert names == {
        f"{name}.png"
        for name in (
            "landing_map",
            "release",
            "target_coverage",
            "parameters",
            "outcomes",
            "limits",
            "ballistic_residuals",
            "ball_paths",
            "joint_tracking",
        )
    }
    for picture in (written / "pictures").iterdir():
        pixels = image.imread(picture)
        assert pixels.shape[1] == 1050, picture.name  # 3.5 in at 300 dpi
        assert (pixels[..., :3].min(axis=2) < 0.9).mean() > 0.01, picture.name
        for edge in (pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]):
            assert edge.min() > 0.9, f"{picture.name} is cut off"


def test_what_a_dataset_says_is_never_markup(collection: Any, tmp_path: Path) -> None:
    hostile = "</script><script>alert('$x')</script> & <b>"
    collection.refuse(4, hostile)
    directory = collection.collect(tmp_path / "dataset", [0, 1, 2, 3, 5, 6])
    card = directory / CARD
    card.write_text(card.read_text(encoding="utf-8") + "| host | <img src=x onerror=alert(1)> |\n", encoding="utf-8")
    page = report(directory, tmp_path / "page.html")
    assert len(page.named("script")) == len(page.plots) + 2
    assert not page.named("img")
    assert ("td", hostile) in page.texts
    assert ("code", "<img src=x onerror=alert(1)>") in page.texts


def test_what_a_plot_says_does_not_end_the_script_that_holds_it(collected: Path) -> None:
    facts = gather(Dataset.open(collected))
    hostile = "a.</script ><b>"
    text = html(replace(facts, parameters=(replace(facts.parameters[0], key=hostile),)))
    assert "</script " not in text
    plots = Page(text).plots
    assert plots["parameters-pairs"]["layout"]["xaxis"]["title"]["text"] == "</script ><b><br>a [s]"


@pytest.mark.parametrize(
    ("settings", "refused", "lost"),
    [
        ({"sweep": {"sampler": "grid", "parameters": {"task.duration_s": {"values": [1.0]}}}}, [], []),
        ({"trials": 1}, [], [0]),
        ({"trials": 4}, [0, 1, 3], []),
    ],
    ids=["a single throw", "no landing", "all refused but one"],
)
def test_datasets_with_little_in_them(
    make_collection: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    settings: dict[str, Any],
    refused: list[int],
    lost: list[int],
) -> None:
    collection = make_collection({"trials": None, **settings})
    for trial in refused:
        collection.refuse(trial, "too fast")
    trials = [trial.number for trial in collection.plan.trials if trial.number not in refused]
    directory = collection.collect(tmp_path / "dataset", trials, lost=lost)
    monkeypatch.setattr("throwcollect.report.pictures.DPI", 50)
    written = write_report(directory, tmp_path / "page.html", pictures=tmp_path / "pictures")
    page = Page(written.page.read_text(encoding="utf-8"))
    assert [attributes["id"] for attributes in page.named("section")] == SECTIONS
    assert ("No ball crossed the landing plane." in page.words) == bool(lost)
    assert "This dataset has no journal of its collection" in page.words
    assert len(written.pictures) == (2 if lost else 9)
    for picture in written.pictures:
        assert image.imread(picture)[..., :3].min() < 0.9, picture.name


def test_eight_keys_are_drawn_in_pairs_and_more_are_named(make_collection: Any, tmp_path: Path) -> None:
    keys = [f"task.{end}.{joint}" for end in ("start", "end") for joint in ("torso_1_joint", "arm_right_4_joint")]
    keys += ["task.duration_s", "ball.mass_kg", "ball.friction", "ball.restitution", "scene.gravity_mps2"]
    parameters = {key: {"min": 0.2, "max": 0.9} for key in keys}
    collection = make_collection({"trials": 20, "sweep": {"sampler": "sobol", "parameters": parameters}})
    directory = collection.collect(tmp_path / "dataset", lost=range(20))
    page = report(directory, tmp_path / "page.html")
    plot = page.plots["parameters-pairs"]
    assert sum(trace["type"] == "bar" for trace in plot["data"]) == 8
    assert sum(trace["type"] == "scatter" for trace in plot["data"]) == 28
    assert "The first 8 of 9 swept keys." in page.words
    assert all(("code", key) in page.texts for key in keys)


def test_an_unfinished_dataset_is_refused_and_nothing_written(dataset: Path, tmp_path: Path) -> None:
    (dataset / METADATA).unlink()
    with pytest.raises(DatasetError, match=r"not finished|unfinished"):
        write_report(dataset, tmp_path / "page.html", pictures=tmp_path / "pictures")
    assert [path.name for path in tmp_path.iterdir()] == ["dataset"]


def test_what_is_there_is_never_overwritten(collected: Path, tmp_path: Path) -> None:
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


def test_without_plotly_the_message_says_how_to_get_it(
    collected: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("throwcollect.report.write.find_spec", {}.get)
    with pytest.raises(ConfigError, match="needs plotly and matplotlib, which are not installed") as raised:
        write_report(collected, tmp_path / "page.html", pictures=tmp_path / "pictures")
    assert raised.value.hint == "pip install 'throwcollect[report]'"


def test_the_command_writes_beside_the_dataset_and_says_what(dataset: Path, tmp_path: Path) -> None:
    printed = CliRunner().invoke(dataset_app, ["report", str(dataset), "--json"])
    assert printed.exit_code == 0, printed.output
    found = json.loads(printed.output)
    assert found["page"] == str(tmp_path / "dataset.html")
    assert found["size_bytes"] == (tmp_path / "dataset.html").stat().st_size
    assert found["pictures"] == []


def test_the_documented_command_gives_the_same_report_again_with_or_without_a_display(
    collected: Path, written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (Path(__file__).parents[3] / "docs" / "report.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"^throwcollect dataset (report .*)$", text, flags=re.MULTILINE)
    shutil.copytree(collected, tmp_path / "datasets" / "quick")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DISPLAY", "nowhere:7")
    with mpl.rc_context({"backend": "tkagg"}):
        printed = CliRunner().invoke(dataset_app, command.split())
    assert printed.exit_code == 0, printed.output
    pictures = {path.name: path for path in tmp_path.rglob("*.png")}
    assert set(re.findall(r"^\| `(\w+\.png)` \|", text, flags=re.MULTILINE)) == set(pictures)
    assert (tmp_path / "quick.html").read_bytes() == (written / "page.html").read_bytes()
    for name, path in pictures.items():
        assert path.read_bytes() == (written / "pictures" / name).read_bytes(), name
