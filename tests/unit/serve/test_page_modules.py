"""Modules of the page: messages of the server, replays, coarse meshes, landings and plots."""

from __future__ import annotations

import json
import os
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from throwcollect.serve import app

PAGE = Path(app.__file__).parent / "page"
PARSE = """
for (const path of process.argv.slice(1)) {
  new vm.SourceTextModule(fs.readFileSync(path, "utf8"), { identifier: path });
}
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node, which reads modules without a browser")
def test_node_can_parse_every_module_of_the_page() -> None:
    command = ["node", "--experimental-vm-modules", "--no-warnings", "--eval", PARSE, *sorted(PAGE.glob("*.js"))]
    done = subprocess.run(command, env={**os.environ, "NODE_OPTIONS": ""}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("script", ["page_modules.mjs", "page_elements.mjs"])
def test_the_javascript_tests_of_the_page_pass(tmp_path: Path, script: str) -> None:
    if (node := shutil.which("node")) is None:
        pytest.skip("needs node, which runs modules of the page without a browser")
    header = {"trial": 7, "outcome": "landed", "joints": ["elbow", "wrist"], "samples": 3, "rate_hz": 100.0}
    text = json.dumps({**header, "landing": [1.5, -0.25, 0.0]}).encode()
    path = [(0, 1, 2), (1, 2, 3), (2, 3, 4)]
    poses = [number for place in path for number in (*place, 0, 0, 0, 1)]
    numbers = [0, 10, 1, 11, 2, 12, *(number for place in path for number in place), *poses]
    message = (
        struct.pack("<I", len(text)) + text + b"\0" * (-len(text) % 4) + struct.pack(f"<{len(numbers)}f", *numbers)
    )
    (tmp_path / "throw").write_bytes(message)
    # NODE_OPTIONS may name a module that node would load first.
    environment = {
        **os.environ,
        "PAGE": str(PAGE),
        "THROW": str(tmp_path / "throw"),
        "NODE_OPTIONS": "",
    }
    command = [node, "--test", Path(__file__).with_name(script)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
