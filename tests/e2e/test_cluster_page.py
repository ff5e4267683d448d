"""The script that docs/running.md shows for other schedulers works."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from tests.e2e.collection import CONFIG, FAST, collect_here, fingerprints, write_config
from tests.pages import read_section


def test_the_documented_shell_loop_collects_all_slices(tmp_path: Path) -> None:
    marked = rf"<!-- run by tests/e2e/{Path(__file__).name} -->\n```sh\n(.*?)```"
    (script,) = re.findall(marked, read_section("running.md", "Other schedulers"), flags=re.DOTALL)
    script = script.replace("0 1 2 3", "0 1").replace("/4 ", "/2 ")
    assert "$index/2" in script
    text = CONFIG.replace("local", "inprocess") + "record: {{trials_per_shard: 2}}\n"
    config = write_config(tmp_path, trials=6, text=text, sim=FAST).rename(tmp_path / "throws.yaml")
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    subprocess.run(["sh", "-e", "-c", script], cwd=tmp_path, check=True, env=environment)
    collect_here(config, tmp_path / "whole")
    assert fingerprints(tmp_path / "data") == fingerprints(tmp_path / "whole")
