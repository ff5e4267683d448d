from pathlib import Path

import pytest

from throwcollect.dataset.directory import DIRECTORY_VARIABLE, find_known_directory


def test_a_directory_in_a_container_is_named_as_on_the_host(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(DIRECTORY_VARIABLE, raising=False)
    assert find_known_directory(Path("/data")) == Path("/data")
    monkeypatch.setenv(DIRECTORY_VARIABLE, "/home/me/my data")
    assert find_known_directory(Path("/data")) == Path("/home/me/my data")
    monkeypatch.setenv(DIRECTORY_VARIABLE, "")
    assert find_known_directory(Path("/data")) is None
