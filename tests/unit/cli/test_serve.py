"""What `serve` refuses before it listens."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from throwcollect.cli.main import main


@pytest.mark.parametrize("option", ["--datasets", "--models"])
def test_a_file_in_place_of_a_directory_is_refused(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    # The address does not exist, so that the server ends, too, where the file is taken.
    address = ["--host", "192.0.2.1", "--in-the-clear"]
    monkeypatch.setattr(sys, "argv", ["throwcollect", "serve", *address, option, str(tmp_path / "file")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert f"throwcollect: {option} {tmp_path}/file: should be a directory, is a file" in capsys.readouterr().err
