"""Outcomes have the same colours wherever they are drawn."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from throwcollect.serve import app
from throwcollect.tasks.outcome_styles import STYLES, style_of

PAGE = Path(app.__file__).parent / "page"
SCRIPT = """
import(process.argv[1]).then(({ addSuccess, colorOf }) => {
  addSuccess("swung");
  console.log(JSON.stringify(JSON.parse(process.argv[2]).map(colorOf)));
});
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node, which runs modules of the page")
def test_the_page_has_the_colours_of_reports() -> None:
    names = [*STYLES, "swung", "stuck", "slipped", "größer"]
    command = ["node", "--no-warnings", "--eval", SCRIPT, str(PAGE / "outcomes.js"), json.dumps(names)]
    done = subprocess.run(command, env={**os.environ, "NODE_OPTIONS": ""}, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == [style_of(name, "swung").colour for name in names]


def test_the_success_of_any_task_looks_like_a_landing() -> None:
    assert style_of("swung", "swung") == style_of("landed")
    assert style_of("swung") != style_of("landed")
