"""Checking a SIF with a fake Apptainer, which prints what a test wants."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from throwcollect.collect.cluster.submit import check_sif
from throwcollect.collect.runtimes.image_sources import SOURCES_LABEL, VERSION_LABEL, digest_sources
from throwcollect.errors import ConfigError
from throwcollect.version import __version__


def put_apptainer(directory: Path, lines: str) -> None:
    program = directory / "apptainer"
    program.write_text(f"#!/bin/sh\n{lines}\n")
    program.chmod(0o755)


@pytest.mark.parametrize(
    ("labels", "problem"),
    [
        ({}, None),
        ({VERSION_LABEL: __version__, SOURCES_LABEL: digest_sources()}, None),
        ({VERSION_LABEL: "0.0.1"}, "holds throwcollect 0.0.1"),
        ({VERSION_LABEL: __version__, SOURCES_LABEL: "0" * 64}, "was made from other sources"),
    ],
)
def test_a_sif_of_another_version_or_of_other_sources_is_rejected(
    labels: dict[str, str], problem: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "inspected").write_text(json.dumps({"data": {"attributes": {"labels": labels}}}))
    put_apptainer(tmp_path, f'/bin/cat "{tmp_path}/inspected"')
    monkeypatch.setenv("PATH", str(tmp_path))
    if problem is None:
        check_sif(tmp_path / "it.sif")
    else:
        with pytest.raises(ConfigError, match=problem) as caught:
            check_sif(tmp_path / "it.sif")
        assert "make sif" in str(caught.value.hint)
