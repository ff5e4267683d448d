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
from throwcollect.errors import ConfigError


def test_view_takes_trials_as_numbers_and_ranges_in_the_given_order() -> None:
    assert read_trials("7-9, 3,5-5,3") == [7, 8, 9, 3, 5]


@pytest.mark.parametrize("text", ["", "3,", "3;4", "-1", "1-99999999999", "9-7"])
def test_view_refuses_malformed_lists_of_trials(text: str) -> None:
    with pytest.raises(ConfigError, match="--trials: got '"):
        read_trials(text)


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
    assert f"STL, {found['mesh_bytes'] / 1e6:.1f} MB" in page
    topics = {
        topic for cell in re.findall(r"^\| (`/.*?) \|", page, re.MULTILINE) for topic in re.findall("`(.*?)`", cell)
    }
    recorded = Path("views/quick/metadata.yaml").read_text(encoding="utf-8")
    assert topics == set(re.findall(r"name: (/.*)", recorded))


def test_view_prints_the_command_that_opens_the_recording(tmp_path: Path) -> None:
    Collection({"trials": 1}).collect(tmp_path / "quick")
    output = tmp_path / "my view"
    result = CliRunner().invoke(
        assemble(), ["dataset", "view", str(tmp_path / "quick"), str(output)], catch_exceptions=False
    )
    assert result.stdout.startswith(f"{output}/throws.mcap: 1 throw, ")
    assert f"ROS_PACKAGE_PATH='{output}' rerun '{output}/throws.mcap'" in result.stdout
