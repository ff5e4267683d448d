"""Options of `up` that do not go together."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from throwcollect.cli.collect import up
from throwcollect.errors import ConfigError


@pytest.mark.parametrize(
    ("option", "given"),
    [
        ("CONFIG", {"config": Path("throws.yaml")}),
        ("--resume", {"resume": Path("data")}),
        ("--token-file", {"token_file": Path("token")}),
        ("--detach", {"detach": True}),
        ("--view", {"view": True}),
    ],
)
def test_what_a_slice_has_no_use_for_is_refused_and_not_forgotten(
    option: str, given: dict[str, Any], tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=f"^{option}: should be left out with --slice"):
        up(slice="0/2", output=tmp_path / "data", **given)
