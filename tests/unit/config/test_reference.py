import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]


def print_reference(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Print the reference where a robot, a task and a format of other packages are installed."""
    path = os.pathsep.join([str(ROOT / "tests" / "plugins"), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-m", "throwcollect.config.reference", *arguments],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_page_is_up_to_date_whatever_is_installed() -> None:
    done = print_reference()
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8"), (
        "run python -m throwcollect.config.reference --output docs/configuration.md"
    )


def test_a_file_holds_what_is_printed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    done = print_reference("--output", page)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert page.read_text(encoding="utf-8") == print_reference().stdout
