"""Processes and imports at the start of a collection."""

import contextlib
import os
import pty
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from throwcollect import runs
from throwcollect.errors import ConfigError

COLLECTION = """
name: start
trials: 1
sim: {{engine: ballistic}}
run: {{runtime: local}}
sweep:
  parameters:
    task.duration_s: {{min: {least}, max: {most}}}
"""


@pytest.fixture
def yaml(tmp_path: Path) -> Callable[..., Path]:
    def write(least: float = 1.1, most: float = 1.2) -> Path:
        path = tmp_path / "start.yaml"
        path.write_text(COLLECTION.format(least=least, most=most))
        return path

    return write


def _servers() -> list[psutil.Process]:
    return [each for each in psutil.Process().children() if "node_server" in " ".join(each.cmdline())]


def test_no_process_of_a_collection_imports_pandas(yaml, tmp_path: Path) -> None:
    imported = tmp_path / "imported"
    (tmp_path / "before" / "pandas").mkdir(parents=True)
    (tmp_path / "before" / "pandas" / "__init__.py").write_text(
        f"import sys\nopen({str(imported)!r}, 'a').write(f'{{sys.orig_argv}}\\n')\n"
    )
    path = os.pathsep.join([str(tmp_path / "before"), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-m", "throwcollect", "up", "-n", "1", "--output", tmp_path / "data", yaml()]
    subprocess.run(command, env={**os.environ, "PYTHONPATH": path}, check=True, capture_output=True)
    assert not imported.exists(), imported.read_text()


@pytest.mark.parametrize("on_terminal", [False, True])
def test_a_collection_starts_one_interpreter_and_forks_its_nodes(on_terminal, yaml, tmp_path: Path) -> None:
    started = tmp_path / "started"
    (tmp_path / "before").mkdir()
    (tmp_path / "before" / "sitecustomize.py").write_text(
        f"import sys\nopen({str(started)!r}, 'a').write(f'{{sys.orig_argv}}\\n')\n"
    )
    path = os.pathsep.join([str(tmp_path / "before"), *filter(None, [os.environ.get("PYTHONPATH")])])
    words = ["up", "-n", "2", "--set", "run.replay=0", "--output", tmp_path / "data", yaml()]
    command = [sys.executable, "-m", "throwcollect", *words]
    reader, writer = pty.openpty() if on_terminal else os.pipe()
    with subprocess.Popen(
        command, env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.DEVNULL, stderr=writer
    ) as running:
        os.close(writer)
        said = b""
        # A process that writes to an unread terminal would block. On Linux, reading at its end is an error.
        with contextlib.suppress(OSError):
            while piece := os.read(reader, 65536):
                said += piece
    os.close(reader)
    assert running.returncode == 0, said
    # A bar hides the cursor.
    assert (b"\x1b[?25l" in said) == on_terminal
    assert len(started.read_text().splitlines()) == 1, started.read_text()


def test_the_node_server_ends_with_a_refused_or_abandoned_run(yaml, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="all refused"):
        runs.prepare(yaml(least=0.1, most=0.11), output=tmp_path / "data", ahead=True)
    assert not _servers()
    assert not (tmp_path / "data").exists()
    with runs.prepare(yaml(), output=tmp_path / "data", ahead=True):
        assert len(_servers()) == 1
    assert not _servers()
    with runs.prepare(yaml(), output=tmp_path / "data"):
        assert not _servers()
