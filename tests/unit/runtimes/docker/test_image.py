"""Building the image with a fake engine: what goes into the build, and the messages of failures."""

from __future__ import annotations

import io
import re
import subprocess
import tarfile
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from docker.errors import APIError, ImageNotFound

import throwcollect
from throwcollect.errors import ConfigError, WorkerError
from throwcollect.runtimes.docker.image import build, default_tag, ensure, is_outdated
from throwcollect.runtimes.image_sources import (
    SOURCES_LABEL,
    digest_sources,
    find_address,
)

ROOT = Path(__file__).parents[4]
DOCKERFILE = (ROOT / "docker" / "Dockerfile").read_text(encoding="utf-8")
COPIED = [name for line in re.findall(r"^COPY (?!--from)(.*) \S+$", DOCKERFILE, re.MULTILINE) for name in line.split()]


class Engine:
    """Images by name, and the answers to a build; a build that ends well makes the image."""

    def __init__(
        self, *images: str, registry: tuple[str, ...] = (), answers: list[dict[str, str]] | None = None
    ) -> None:
        self.here = set(images)
        self.registry = registry
        self.answers = answers or [{"stream": "Step 1/1 : FROM   base\n"}]
        self.images = self.api = self
        self.pulled: list[str] = []
        self.labels: dict[str, str] = {}
        self.options: dict[str, Any] = {}
        self.context: dict[str, tarfile.TarInfo] = {}

    def get(self, name: str) -> SimpleNamespace:
        if name not in self.here:
            raise ImageNotFound(f"no such image: {name}")
        return SimpleNamespace(attrs={"Size": 1234}, labels=self.labels)

    def pull(self, name: str) -> None:
        if name not in self.registry:
            raise APIError("500 Server Error", explanation="no such host")
        self.pulled.append(name)
        self.here.add(name)

    def build(self, fileobj: io.BufferedIOBase, **options: Any) -> Iterator[dict[str, str]]:
        self.options = options
        with tarfile.open(fileobj=fileobj) as archive:
            self.context = {member.name: member for member in archive}
        yield from self.answers
        if not any("error" in answer for answer in self.answers):
            self.here.add(options["tag"])


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def wheelhouse(tmp_path: Path) -> Path:
    directory = tmp_path / "wheels"
    directory.mkdir()
    (directory / "numpy-2.whl").write_bytes(b"")
    (directory / "throwcollect_ros_interfaces-1.whl").write_bytes(b"")
    (directory / "made-from.sha256").write_bytes(b"")
    return directory


def test_a_build_uses_the_target_and_the_arguments_of_the_dockerfile(said: list[str]) -> None:
    engine = Engine("base")
    build(engine, "mine", base="base", say=said.append)
    assert f" AS {engine.options['target']}\n" in DOCKERFILE
    # ROS_IMAGE is only for builds of the target with ROS.
    declared = set(re.findall(r"^ARG (\w+)", DOCKERFILE, re.MULTILINE)) - {"ROS_IMAGE"}
    assert set(engine.options["buildargs"]) == declared
    assert engine.options["buildargs"]["VERSION"] == throwcollect.__version__


def test_the_build_context_holds_only_what_the_dockerfile_copies(said: list[str], wheelhouse: Path) -> None:
    engine = Engine("base")
    build(engine, "mine", base="base", wheelhouse=wheelhouse, say=said.append)
    assert "src" in COPIED
    for source in COPIED:
        assert any(fnmatch(name, f"{source}*") for name in engine.context), source
    files = {name for name, member in engine.context.items() if member.isfile()}
    assert {Path(name).name for name in files if name.startswith("docker/wheelhouse/")} == {
        "numpy-2.whl",
        "throwcollect_ros_interfaces-1.whl",
    }
    above = {"configs", "docker", "packaging", "pyproject.toml", "src"}
    assert {name.partition("/")[0] for name in files} == above
    assert not [name for name in files if "__pycache__" in name or ".egg-info" in name]
    assert {member.uid for member in engine.context.values()} == {0}


def test_a_failed_build_step_shows_the_end_of_its_output_without_colours(said: list[str]) -> None:
    output = [{"stream": f"\x1b[91mline {number}\n\x1b[0m"} for number in range(100)]
    engine = Engine("base", answers=[*output, {"stream": "Removing intermediate container 1\n"}, {"error": "code: 1"}])
    with pytest.raises(WorkerError, match="mine: cannot be built: code: 1") as caught:
        build(engine, "mine", base="base", say=said.append)
    assert caught.value.evidence is not None
    assert caught.value.evidence.splitlines()[-1] == "line 99"
    assert "line 0" not in caught.value.evidence.splitlines()


@pytest.mark.parametrize("exists", [True, False])
def test_a_wheelhouse_without_wheels_is_refused_before_anything_is_built(
    said: list[str], tmp_path: Path, exists: bool
) -> None:
    engine = Engine("base")
    with pytest.raises(ConfigError, match="holds no wheels"):
        build(engine, "mine", base="base", wheelhouse=tmp_path if exists else tmp_path / "none", say=said.append)
    assert not engine.options


def test_a_missing_image_other_than_the_default_is_pulled(said: list[str]) -> None:
    engine = Engine(registry=("lab/throws:2",))
    ensure(engine, "lab/throws:2", say=said.append)
    assert engine.pulled == ["lab/throws:2"]
    assert said == ["image lab/throws:2 is not here; pulling it"]


def test_without_a_clone_a_missing_default_image_is_an_error(
    monkeypatch: pytest.MonkeyPatch, said: list[str], tmp_path: Path
) -> None:
    monkeypatch.setattr("throwcollect.runtimes.image_sources._PACKAGE", tmp_path / "lib" / "throwcollect")
    with pytest.raises(WorkerError, match=f"{default_tag()} is not here and cannot be built: .* not in a clone"):
        ensure(Engine(), default_tag(), say=said.append)


def git(root: Path, *arguments: str) -> str:
    identity = ["-c", "user.name=t", "-c", "user.email=t@example.org"]
    return subprocess.run(["git", "-C", root, *identity, *arguments], check=True, capture_output=True, text=True).stdout


@pytest.mark.parametrize(
    ("origin", "address"),
    [
        ("https://me:token@example.org/lab/throws.git", "https://example.org/lab/throws.git"),
        ("https://example.org/lab/throws.git?token=1#x", "https://example.org/lab/throws.git"),
        ("ssh://git@example.org:2222/lab/throws.git", "ssh://example.org:2222/lab/throws.git"),
        ("git@example.org:lab/throws.git", "ssh://example.org/lab/throws.git"),
        # A path on this machine is of no use to others.
        ("/work/throws.git", None),
        ("../throws", None),
        ("file:///work/throws.git", None),
        (None, None),
    ],
)
def test_the_source_address_of_an_image_is_public_and_has_no_secrets(
    tmp_path: Path, origin: str | None, address: str | None
) -> None:
    assert find_address(tmp_path) is None
    git(tmp_path, "init", "-q")
    if origin is not None:
        git(tmp_path, "remote", "add", "origin", origin)
    assert find_address(tmp_path) == address


def test_an_image_is_outdated_if_its_label_names_other_sources(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    engine = Engine("base")
    build(engine, "mine", base="base", say=lambda _line: None)
    own = engine.options["buildargs"]["SOURCES"]
    for labels, outdated in (({}, False), ("unknown", False), (own, False), ("0" * 64, True)):
        engine.labels = labels and {SOURCES_LABEL: labels}
        assert is_outdated(engine, "mine") == outdated
    monkeypatch.setattr("throwcollect.runtimes.image_sources._PACKAGE", tmp_path / "lib" / "throwcollect")
    assert not is_outdated(engine, "mine")


def test_every_installed_file_changes_the_digest_of_the_sources(said: list[str], tmp_path: Path) -> None:
    (tmp_path / "src" / "__pycache__").mkdir(parents=True)
    changes = {"pyproject.toml": "a", "src/a.py": "a", "src/b.py": "a", "src/__pycache__/a.pyc": "a"}
    for name, content in changes.items():
        (tmp_path / name).write_text(content)
    digests = [digest_sources(tmp_path)]
    for name in changes:
        (tmp_path / name).write_text("b")
        digests.append(digest_sources(tmp_path))
    assert len(set(digests)) == 4
    assert digests[-1] == digests[-2]
