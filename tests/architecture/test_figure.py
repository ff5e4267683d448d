"""The figures of the architecture show the rooms and imports of the sources, as the scripts draw them."""

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


def test_the_committed_figure_matches_the_sources(figure: ModuleType) -> None:
    assert figure.FIGURE.read_text(encoding="utf-8") == figure.draw(), "python packaging/architecture_figure.py"


def test_the_document_shows_the_figure_and_names_every_room(figure: ModuleType) -> None:
    imported, _ = figure.read_imports()
    assert "](architecture.svg)" in DOCUMENT
    assert figure.PLACES.keys() <= imported.keys()
    assert [room for room in imported if f"`{room}`" not in DOCUMENT] == []


def test_the_committed_flow_figures_match_and_are_shown(flows: ModuleType) -> None:
    drawn = {path.stem: path.read_text(encoding="utf-8") for path in flows.FIGURES.iterdir()}
    assert drawn == {name: flows.draw(flow) for name, flow in flows.FLOWS.items()}, "python packaging/flow_figures.py"
    assert [name for name in drawn if f"](figures/{name}.svg)" not in DOCUMENT] == []
