"""Processes and imports at the start of a collection."""

import os
import subprocess
import sys
from pathlib import Path

COLLECTION = """
name: start
trials: 1
sim: {engine: ballistic}
run: {runtime: local}
sweep:
  parameters:
    task.duration_s: {min: 1.1, max: 1.2}
"""


def test_no_process_of_a_collection_imports_pandas(tmp_path: Path) -> None:
    yaml = tmp_path / "start.yaml"
    yaml.write_text(COLLECTION)
    imported = tmp_path / "imported"
    (tmp_path / "before" / "pandas").mkdir(parents=True)
    (tmp_path / "before" / "pandas" / "__init__.py").write_text(
        f"import sys\nopen({str(imported)!r}, 'a').write(f'{{sys.orig_argv}}\\n')\n"
    )
    path = os.pathsep.join([str(tmp_path / "before"), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-m", "throwcollect", "up", "-n", "1", "--output", tmp_path / "data", yaml]
    subprocess.run(command, env={**os.environ, "PYTHONPATH": path}, check=True, capture_output=True)
    assert not imported.exists(), imported.read_text()
