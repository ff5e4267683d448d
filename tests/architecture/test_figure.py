"""The figures of the architecture: what scripts draw, and the rooms and imports that there are."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


DOCUMENT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


@pytest.fixture
def figure(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "packaging")
    return importlib.import_module("architecture_figure")


@pytest.fixture
def flows(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "packaging")
    return importlib.import_module("flow_figures")


def test_the_figure_is_the_one_that_the_sources_give(figure: ModuleType) -> None:
    assert figure.FIGURE.read_text(encoding="utf-8") == figure.draw(), "python packaging/architecture_figure.py"


def test_every_room_is_drawn_and_stands_in_the_document(figure: ModuleType) -> None:
    imported, _ = figure.read_imports()
    assert "](architecture.svg)" in DOCUMENT
    assert figure.PLACES.keys() <= imported.keys()
    assert [room for room in imported if f"`{room}`" not in DOCUMENT] == []


def test_arrows_that_follow_from_others_are_left_out(figure: ModuleType) -> None:
    imported = {room: set() for room in figure.PLACES} | {"cli": {"runs", "dataset"}, "runs": {"dataset"}}
    assert figure.reduce_arrows(imported) == [("cli", "runs"), ("runs", "dataset")]


def test_what_imports_a_room_does_not_lie_below_all(figure: ModuleType) -> None:
    imported = {room: set() for room in figure.PLACES} | {"wording": {"config"}}
    with pytest.raises(ValueError, match="wording imports config"):
        figure.reduce_arrows(imported)


def test_flows_are_drawn_and_shown(flows: ModuleType) -> None:
    drawn = {path.stem: path.read_text(encoding="utf-8") for path in flows.FIGURES.iterdir()}
    assert drawn == {name: flows.draw(flow) for name, flow in flows.FLOWS.items()}, "python packaging/flow_figures.py"
    assert [name for name in drawn if f"](figures/{name}.svg)" not in DOCUMENT] == []
