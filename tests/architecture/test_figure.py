"""The figure of the architecture shows the rooms and imports that there are."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def figure() -> ModuleType:
    spec = importlib.util.spec_from_file_location("architecture_figure", ROOT / "packaging" / "architecture_figure.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_figure_is_the_one_that_the_sources_give(figure: ModuleType) -> None:
    assert figure.FIGURE.read_text(encoding="utf-8") == figure.draw(), "python packaging/architecture_figure.py"


def test_every_room_is_drawn_and_stands_in_the_document(figure: ModuleType) -> None:
    imported, _ = figure.read_imports()
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert "](architecture.svg)" in text
    assert figure.PLACES.keys() <= imported.keys()
    assert [room for room in imported if f"`{room}`" not in text] == []


def test_arrows_that_follow_from_others_are_left_out(figure: ModuleType) -> None:
    imported = {room: set() for room in figure.PLACES} | {"cli": {"runs", "dataset"}, "runs": {"dataset"}}
    assert figure.reduce_arrows(imported) == [("cli", "runs"), ("runs", "dataset")]


def test_what_imports_a_room_does_not_lie_below_all(figure: ModuleType) -> None:
    imported = {room: set() for room in figure.PLACES} | {"wording": {"config"}}
    with pytest.raises(ValueError, match="wording imports config"):
        figure.reduce_arrows(imported)
