"""Where a dataset goes if nobody says so."""

import re
from pathlib import Path

import pytest

from throwcollect.runs.preparation import _name_directory


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
