"""`resume --no-simulate` finishes a dataset without an engine."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from tests.unit.dataset.conftest import Collection

WITHOUT = """
import sys
sys.modules |= dict.fromkeys(("pybullet", "mujoco", "zenoh"))
from throwcollect.cli.main import main
main()
"""


def test_a_damaged_dataset_is_finished_without_the_libraries_that_simulate(tmp_path: Path) -> None:
    directory = Collection().collect(tmp_path / "dataset")
    digest = json.loads((directory / "datapackage.json").read_text())["resources"]
    (directory / "quick_00001.mcap").unlink()
    command = [sys.executable, "-c", WITHOUT, "resume", directory, "--no-simulate", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 5, done.stderr
    assert json.loads(done.stdout)["outcomes"] == {"landed": 4, "lost": 3}
    assert f"throwcollect resume {directory} runs them again" in done.stderr
    kept = json.loads((directory / "datapackage.json").read_text())["resources"]
    assert [each for each in digest if each["path"] in ("quick_00000.mcap", "quick_00002.mcap")] == [
        each for each in kept if each["path"].endswith(".mcap")
    ]
