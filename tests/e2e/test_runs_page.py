"""The programs of docs/running.md, as it stands there."""

from pathlib import Path

import pytest

from tests.e2e.collection import FAST
from tests.pages import find_blocks, read_section
from throwcollect.dataset.inspect import info
from throwcollect.state_directory import STATE_VARIABLE

pytestmark = pytest.mark.e2e

ROOT = Path(__file__).parents[2]
BLOCKS = find_blocks("python", read_section("running.md", "From Python"))


def test_two_runs_of_one_program_are_followed_side_by_side(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    text = (ROOT / "configs" / "quickstart.yaml").read_text(encoding="utf-8")
    (tmp_path / "configs").mkdir()
    # The page says nothing of contacts, nor of replays; and the first run must not be over when the second has begun.
    (tmp_path / "configs" / "quickstart.yaml").write_text(
        f"{text}\nsim: {{{FAST}, real_time_factor: 1}}\nrun: {{replay: 0}}\n"
    )
    exec("\n".join(BLOCKS), {})  # noqa: S102
    *progress, first, second, third = capsys.readouterr().out.splitlines()
    assert any(line.startswith("6/6 throws: ") for line in progress)
    for line, name in ((first, "first"), (second, "second")):
        assert line.endswith(f"{{'landed': 6}} {info(tmp_path / name).digest}")
    assert info(tmp_path / "first").digest != info(tmp_path / "second").digest
    assert third == "{'landed': 3}"
