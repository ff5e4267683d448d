"""The definition that an image is built from where there is no Docker engine."""

from __future__ import annotations

import re
from pathlib import Path

DOCKER = Path(__file__).parents[4] / "docker"


def test_the_image_has_the_extras_that_a_docker_engine_installs() -> None:
    dockerfile = (DOCKER / "Dockerfile").read_text(encoding="utf-8")
    (requirements,) = re.findall(r".*open\('/requirements.txt', 'w'\).*", dockerfile)
    (extras,) = re.findall(r"'/source\[(.*)\]'", (DOCKER / "throwcollect.def").read_text(encoding="utf-8"))
    assert extras.split(",") == re.findall(r"extras\['(\w+)'\]", requirements)
