import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from throwcollect.runtime.node_logs import NodeLogs


@pytest.mark.parametrize(("printed", "before"), [("", ""), ("at work\n", "at work\n")])
def test_a_log_that_a_full_disk_has_cut_off_ends_with_the_reason(
    printed: str, before: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    logs = NodeLogs(tmp_path)
    logs.path("sim_0").write_text(printed)
    assert logs.tail("sim_0") == printed.strip()
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=512) if path == tmp_path else None)
    assert logs.tail("sim_0") == (f"{before}the disk of {tmp_path} is full: 512 bytes are free; free space, and resume")


def test_a_node_without_a_log_has_said_nothing(tmp_path: Path) -> None:
    assert NodeLogs(tmp_path / "none").tail("sim_0") == ""
