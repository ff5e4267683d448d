import subprocess
from pathlib import Path

from tests.with_plugins import run_with_plugins

ROOT = Path(__file__).parents[3]


def print_reference(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return run_with_plugins("throwcollect.config.reference", *arguments)


def test_the_page_on_configuration_is_up_to_date_even_with_plugins_installed() -> None:
    done = print_reference()
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8"), (
        "run python -m throwcollect.config.reference --output docs/configuration.md"
    )


def test_the_output_option_writes_the_same_page_as_is_printed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    done = print_reference("--output", page)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert page.read_text(encoding="utf-8") == print_reference().stdout
