"""`dataset view`, which prepares throws for viewers, does what `docs/dataset.md` shows."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest
from tests.pages import read_section
from tests.unit.dataset.conftest import Collection
from typer.testing import CliRunner

from throwcollect.cli.dataset.writing import read_trials
from throwcollect.cli.main import assemble


def test_view_takes_trials_as_numbers_and_ranges_in_the_given_order() -> None:
    assert read_trials("7-9, 3,5-5,3") == [7, 8, 9, 3, 5]


def test_the_page_on_viewing_lists_the_files_and_topics_that_view_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = read_section("dataset.md", "Foxglove, Rerun, RViz")
    (command,) = re.findall(r"^throwcollect (dataset view .*)$", page, re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    Collection().collect(tmp_path / "datasets" / "quickstart")
    result = CliRunner().invoke(assemble(), [*shlex.split(command), "--json"], catch_exceptions=False)
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert (found["throws"], found["recording"]) == (4, "views/quick/throws.mcap")
    written = {entry.name + "/" * entry.is_dir() for entry in Path("views/quick").iterdir()}
    listed = re.findall(r"^\| `([\w.-]+/?)` \|", page, re.MULTILINE)
    assert written == set(listed)
    meshes = sum(path.stat().st_size for path in Path("views/quick/example-robot-data").rglob("*.*"))
    assert f"STL, {meshes / 1e6:.1f} MB" in page
    topics = {
        topic for cell in re.findall(r"^\| (`/.*?) \|", page, re.MULTILINE) for topic in re.findall("`(.*?)`", cell)
    }
    recorded = Path("views/quick/metadata.yaml").read_text(encoding="utf-8")
    assert topics == set(re.findall(r"name: (/.*)", recorded))
