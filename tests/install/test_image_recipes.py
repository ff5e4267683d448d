"""What builds images: the Dockerfile, the definition of Apptainer, and the script that labels both."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from throwcollect.collect.runtimes.image_sources import digest_sources
from throwcollect.version import __version__

ROOT = Path(__file__).parents[2]
DOCKERFILE = (ROOT / "docker" / "Dockerfile").read_text(encoding="utf-8")
DEFINITION = (ROOT / "docker" / "throwcollect.def").read_text(encoding="utf-8")


def test_images_are_labelled_with_version_commit_and_digest_of_the_sources() -> None:
    # Without the packages of this environment, as on a machine where nothing was installed.
    command = [sys.executable, "-S", "-I", ROOT / "docker" / "build_arguments.py"]
    words = subprocess.check_output(command, text=True).split()
    assert words[::2] == ["--build-arg"] * 3
    values = dict(word.split("=") for word in words[1::2])
    assert values["VERSION"] == __version__
    assert values["SOURCES"] == digest_sources()
    # Both builders reject an argument that their file does not declare.
    assert set(re.findall(r"^ARG (\w+)", DOCKERFILE, re.MULTILINE)) - {
        "BASE_IMAGE",
        "BUILD_IMAGE",
        "ROS_IMAGE",
        "SELFTEST",
    } == set(values)
    declared = DEFINITION.partition("%arguments")[2].partition("%files")[0]
    assert set(re.findall(r"(\w+)=", declared)) - {"BASE_IMAGE", "BOOTSTRAP"} == set(values)


def test_an_image_that_apptainer_builds_has_the_extras_of_one_that_docker_builds() -> None:
    of_docker, of_apptainer = (
        re.search(r"uv export (.*) -o /?requirements.txt", text)[1] for text in (DOCKERFILE, DEFINITION)
    )
    assert of_docker == of_apptainer
    assert "--extra collect --extra mujoco" in of_docker
