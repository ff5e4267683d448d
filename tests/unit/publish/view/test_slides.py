"""Views and exports of a task that throws nothing name what it moves, and have no landing plane."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.unit.dataset.conftest import Collection
from tests.unit.publish.view.test_viewer_directory import messages_of

from throwcollect.publish.export.export import export
from throwcollect.publish.view.viewer_directory import view


@pytest.fixture(scope="module")
def slides(tmp_path_factory: pytest.TempPathFactory) -> Path:
    settings = {"trials": 2, "task": {"name": "slide"}, "tool": {"name": "paddle"}}
    return Collection(settings).collect(tmp_path_factory.mktemp("slides") / "data")


def test_a_view_of_slides_shows_the_puck_and_draws_no_landing_plane(slides: Path, tmp_path: Path) -> None:
    shown = messages_of(view(slides, tmp_path / "view").recording)
    assert "/bodies/puck/odometry" in shown
    ((_, paths),) = shown["/view/throws"]
    assert {marker.ns for marker in paths.markers} == {"paths"}


def test_the_card_of_exported_slides_reads_the_puck(
    slides: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for to, text in (("npz", "k-th slide"), ("hdf5", "slide that succeeded")):
        export(slides, tmp_path / to, to=to)
        card = (tmp_path / to / "README.md").read_text(encoding="utf-8")
        assert text in card
        monkeypatch.chdir(tmp_path / to)
        found: dict[str, np.ndarray] = {}
        exec(card.split("```python\n")[1].split("```")[0], found)  # noqa: S102
        assert found["puck_position_m"].shape[1] == 3
