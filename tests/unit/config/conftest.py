"""Fixtures that write a configuration and read the problems that loading it reports."""

import textwrap
from pathlib import Path

import pytest

from throwcollect.config.loader import load
from throwcollect.errors import ConfigError


@pytest.fixture
def write(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / "run.yaml"
        path.write_text(textwrap.dedent(text).lstrip("\n"))
        return path

    return write


@pytest.fixture
def problems_of(write):
    """Messages of all problems of a file, without its directory."""

    def problems_of(text: str, *overrides: str) -> list[str]:
        path = write(text)
        with pytest.raises(ConfigError, match=r"\S") as caught:
            load(path, overrides)
        return [str(problem).replace(f"{path.parent}/", "") for problem in caught.value.problems]

    return problems_of
