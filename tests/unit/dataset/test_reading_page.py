"""The examples and names of docs/dataset.md that read work."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tests.pages import find_blocks, read_section

from throwcollect.dataset import reader, throw, trajectories
from throwcollect.dataset.trajectories import list_columns

COLUMNS = tuple(list_columns(["ball"]))

PAGE = read_section("dataset.md", "From Python")
BLOCKS = find_blocks("python", PAGE)


def run(block: str, collected: Path, directory: Path) -> str:
    (directory / "datasets").mkdir()
    shutil.copytree(collected, directory / "datasets" / "quickstart")
    (directory / "example.py").write_text(block, encoding="utf-8")
    command = [sys.executable, "-W", "error::UserWarning", "example.py"]
    ended = subprocess.run(command, check=False, cwd=directory, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def block_with(text: str) -> str:
    (block,) = (block for block in BLOCKS if text in block)
    return block


def test_the_first_example_of_the_page_on_reading_runs(collected: Path, tmp_path: Path) -> None:
    printed = run(block_with("throw.trial"), collected, tmp_path)
    assert "task_duration_s: double" in printed
    assert re.search(r"^6 \(\d+, 32\) \[", printed, flags=re.MULTILINE)


def test_the_numpy_example_runs(collected: Path, tmp_path: Path) -> None:
    printed = run(block_with("lstsq"), collected, tmp_path)
    error = re.search(r"error of a linear model \[m\]: (\S+)", printed)
    assert error
    assert float(error[1]) < 0.01
    assert "'arm_right_4_joint': " in printed


def test_the_example_of_the_page_on_functions_runs(collected: Path, tmp_path: Path) -> None:
    block = find_blocks("python", read_section("python.md", "Python API"))[0]
    assert re.search(r"^-?\d\.\d+ \d\.\d+$", run(block, collected, tmp_path), flags=re.MULTILINE)
    assert (tmp_path / "short-npz" / "throws.npz").is_file()


def test_the_torch_example_runs_with_two_loading_processes(collected: Path, tmp_path: Path) -> None:
    pytest.importorskip("torch")
    printed = run(block_with("num_workers=2"), collected, tmp_path)
    assert re.findall(r"torch\.Size\(\[(\d), 1\]\) torch\.Size\(\[\1, \d+, 3\]\)", printed) == ["4", "3"]


def test_the_page_on_reading_names_all_columns_and_only_existing_attributes() -> None:
    for column in COLUMNS:
        assert f"`{column}`" in PAGE
    for owner, kind in (
        ("dataset", reader.Dataset),
        ("throw", throw.Throw),
        ("trajectories", trajectories.Trajectories),
    ):
        named = set(re.findall(rf"\b{owner}\.(\w+)", PAGE))
        assert named
        for name in named - {"md", "mcap"}:
            assert hasattr(kind, name) or name in kind.__dataclass_fields__, f"{owner}.{name}"
