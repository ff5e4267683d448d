"""Where a dataset goes if nobody says so, and what is refused before anything begins."""

import re
from pathlib import Path

import pytest

from throwcollect.errors import ConfigError
from throwcollect.runs.preparation import _name_directory, prepare


def test_the_name_alone_and_the_time_where_something_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    plain = Path("datasets/quick")
    assert _name_directory("quick") == plain
    plain.mkdir(parents=True)
    assert _name_directory("quick") == plain
    (plain / "plan.parquet").touch()
    assert re.fullmatch(r"datasets/quick-\d{8}-\d{6}", str(_name_directory("quick")))
    (tmp_path / "datasets/link").symlink_to("nowhere")
    assert _name_directory("link") != Path("datasets/link")


def test_wrong_arguments_are_refused_before_anything_is_made(tmp_path: Path) -> None:
    (tmp_path / "some.yaml").write_text("trials: 1\n")
    for wrong, message in (
        ({"processes": -3}, "processes: got -3\n  expected: 1 or more"),
        ({"overrides": "trials=2"}, "overrides: 'trials=2' is a text"),
    ):
        with pytest.raises(ConfigError, match=f"^{message}"):
            prepare(tmp_path / "some.yaml", output=tmp_path / "new", **wrong)
    assert not (tmp_path / "new").exists()
