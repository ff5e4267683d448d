"""The program of docs/runs.md, as it stands there."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.e2e.collection import FAST
from throwcollect.dataset.inspect import digest
from throwcollect.state_directory import STATE_VARIABLE

pytestmark = pytest.mark.e2e

ROOT = Path(__file__).parents[2]
BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "runs.md").read_text(encoding="utf-8"), flags=re.DOTALL)


def test_two_runs_of_one_program_are_followed_side_by_side(tmp_path: Path) -> None:
    text = (ROOT / "configs" / "quickstart.yaml").read_text(encoding="utf-8")
    (tmp_path / "configs").mkdir()
    # The page says nothing of contacts, nor of replays; and the first run must not be over when the second has begun.
    (tmp_path / "configs" / "quickstart.yaml").write_text(
        f"{text}\nsim: {{{FAST}, real_time_factor: 1}}\nrun: {{replay: 0}}\n"
    )
    said = subprocess.run(
        [sys.executable, "-c", "\n".join(BLOCKS)],
        cwd=tmp_path,
        env={**os.environ, STATE_VARIABLE: str(tmp_path / "state")},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert said.returncode == 0, said.stderr
    *progress, first, second, third = said.stdout.splitlines()
    assert any(line.startswith("6/6 throws: ") for line in progress)
    for line, name in ((first, "first"), (second, "second")):
        assert line.endswith(f"{{'landed': 6}} {digest(tmp_path / name)}")
    assert digest(tmp_path / "first") != digest(tmp_path / "second")
    assert third == "{'landed': 3}"
