"""The commands and examples of docs/dataset.md that export work."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import pytest
from tests.pages import find_blocks, read_section
from tests.unit.publish.export.conftest import FORMATS
from typer.testing import CliRunner

from throwcollect.cli.main import assemble
from throwcollect.dataset.inspect import info

PAGE = read_section("dataset.md", "Export")
COMMANDS = [
    shlex.split(line)[1:]
    for line in re.findall(r"^throwcollect dataset export datasets/quickstart.*$", PAGE, re.MULTILINE)
]
OF_IMAGES = re.findall(r"^throwcollect (dataset export datasets/seen.*)$", PAGE, re.MULTILINE)
EXAMPLES = find_blocks("python", PAGE)
IMPORTED = re.compile(r"^(?:import|from) (\w+)", re.MULTILINE)


@pytest.fixture(scope="module")
def place(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory in which the commands of the page have been run."""
    place = tmp_path_factory.mktemp("page")
    shutil.copytree(source, place / "datasets" / "quickstart")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        for command in COMMANDS:
            result = CliRunner().invoke(assemble(), command, catch_exceptions=False)
            assert result.exit_code == 0, result.output
            assert re.fullmatch(
                rf"{command[3]}: 4 throws of 6 trials, \d+ samples at \d+ Hz, \d\.\d MB\n", result.stdout
            )
    return place


def test_the_page_has_a_command_for_every_format(place: Path) -> None:
    assert [command[5] for command in COMMANDS] == list(FORMATS)
    assert sorted(path.name for path in (place / "exports").iterdir()) == sorted(
        ["tables", "arrays", "lerobot", "robomimic", "matlab"]
    )


def run(code: str, directory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in IMPORTED.findall(code):
        pytest.importorskip(name)
    monkeypatch.chdir(directory)
    exec(code, {})  # noqa: S102


@pytest.mark.parametrize("code", EXAMPLES, ids=lambda code: IMPORTED.findall(code)[-1])
def test_the_python_examples_of_the_page_run(code: str, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(code, place, monkeypatch)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[5])
def test_the_python_example_of_every_exported_card_runs(
    command: list[str], place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = place / command[3]
    code = re.findall(r"```python\n(.*?)```", (directory / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert len(code) == (command[5] != "mat")
    for each in code:
        run(each, directory, monkeypatch)


def test_the_commands_of_the_page_export_images(seen: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("av")
    shutil.copytree(seen, tmp_path / "datasets" / "seen")
    monkeypatch.chdir(tmp_path)
    assert len(OF_IMAGES) == 5
    for command in OF_IMAGES:
        result = CliRunner().invoke(assemble(), shlex.split(command.partition("#")[0]), catch_exceptions=False)
        assert result.exit_code == 0, result.output
    videos = {path.parts[1] for path in Path("exports").rglob("*.mp4")}
    assert videos == {"av1", "h264"}
    assert json.loads(Path("exports/states/meta/info.json").read_text())["fps"] == 250


def test_export_with_json_prints_a_summary_as_json(source: Path, tmp_path: Path) -> None:
    arguments = ["dataset", "export", str(source), str(tmp_path / "out"), "--to", "npz", "--rate", "25", "--json"]
    result = CliRunner().invoke(assemble(), arguments, catch_exceptions=False)
    told = json.loads(result.output)
    assert (told["directory"], told["format"], told["trials"], told["episodes"]) == (str(tmp_path / "out"), "npz", 6, 4)
    assert (told["rate_hz"], told["digest"]) == (25, info(source).digest)
    assert info(source).samples / 10 <= told["samples"] < info(source).samples / 10 + 4
