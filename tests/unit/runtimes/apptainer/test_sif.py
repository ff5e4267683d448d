"""Making SIFs with a fake Apptainer: how it is called, and the messages of errors."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from tests.unit.runtimes.apptainer.test_archive import write_archive

import throwcollect
from throwcollect.errors import ConfigError, WorkerError
from throwcollect.runtimes.apptainer.sif import make_sif
from throwcollect.runtimes.apptainer.sif_contents import check_sif, read_labels
from throwcollect.runtimes.image_sources import SOURCES_LABEL, VERSION_LABEL, digest_sources, source_root

SIF = b"#!/usr/bin/env run-singularity\n\0SIF_MAGIC\0"
APPTAINER = """#!/bin/sh
case "$2" in
inspect) /bin/cat "{directory}/inspected" ;;
build)
    printf '%s\\n' "$@" > "{directory}/asked"
    printf '%s\\n' "$PWD" "$APPTAINER_TMPDIR" "$APPTAINER_CONFIGDIR" > "{directory}/where"
    echo image/* > "{directory}/there"
    {build}
    for last; do new="$source"; source="$last"; done
    printf '#!/usr/bin/env run-singularity\\n\\0SIF_MAGIC\\0 new' > "$new"
    ;;
esac
"""


PACKAGE = "throwcollect.runtimes.image_sources._PACKAGE"


@pytest.fixture(scope="module")
def small_clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clone with few sources: to pack and unpack the thousand files of this one takes half a second each time."""
    here, clone = source_root(), tmp_path_factory.mktemp("clone")
    sources = (here / name for name in ("pyproject.toml", "configs/quickstart.yaml", "src/throwcollect/__init__.py"))
    packaged = (path for folder in ("docker", "packaging") for path in (here / folder).iterdir() if path.is_file())
    for path in (*sources, *packaged):
        place = clone / path.relative_to(here)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, place)
    shutil.copytree(here / "packaging" / "ros_interfaces", clone / "packaging" / "ros_interfaces")
    return clone


@pytest.fixture
def apptainer(tmp_path: Path, small_clone: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory with a fake Apptainer, which writes there how it was called, and is given the small clone."""
    monkeypatch.setattr(PACKAGE, small_clone / "src" / "throwcollect")
    directory = tmp_path / "apptainer"
    directory.mkdir()
    write_program(directory)
    monkeypatch.setenv("PATH", str(directory))
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/no-engine.sock")
    return directory


def write_program(directory: Path, build: str = "") -> None:
    program = directory / "apptainer"
    program.write_text(APPTAINER.format(directory=directory, build=build))
    program.chmod(0o755)


def make(output: Path, **named: object) -> list[str]:
    said: list[str] = []
    make_sif(output, say=said.append, **named)  # type: ignore[arg-type]
    return said


def test_an_archive_is_converted_to_a_sif_and_no_other_files_are_left(apptainer: Path, tmp_path: Path) -> None:
    archive = write_archive(tmp_path / "image.tar", "throwcollect")
    make(tmp_path / "it.sif", archive=archive)
    assert (apptainer / "asked").read_text().splitlines()[-2:] == [f"{tmp_path}/it.sif.new", "oci:image"]
    here, work, config = (apptainer / "where").read_text().splitlines()
    assert here == work
    assert config.startswith(work)
    assert not Path(work).exists()
    assert "index.json" in (apptainer / "there").read_text()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["apptainer", "image.tar", "it.sif"]


@pytest.mark.parametrize("named", [{"archive": "image.tar"}, {}])
def test_an_existing_sif_is_replaced_as_a_whole_or_not_at_all(
    named: dict[str, str], apptainer: Path, tmp_path: Path
) -> None:
    write_archive(tmp_path / "image.tar", "throwcollect")
    output = tmp_path / "it.sif"
    output.write_bytes(SIF)
    write_program(apptainer, 'echo half > "$7"; echo "FATAL:   While performing build: it broke" >&2; exit 255')
    with pytest.raises(WorkerError, match=r"it\.sif: cannot be made: While performing build: it broke"):
        make(output, **{name: tmp_path / path for name, path in named.items()})
    assert output.read_bytes() == SIF
    assert not list(tmp_path.glob("*.new"))
    write_program(apptainer)
    make(output, **{name: tmp_path / path for name, path in named.items()})
    assert output.read_bytes() == SIF + b" new"


def test_without_a_docker_engine_a_sif_is_built_from_the_clone(
    apptainer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PACKAGE, Path(throwcollect.__file__).parent)
    said = make(tmp_path / "it.sif", base="lab/python:3.11")
    assert "no Docker engine answers" in said[0]
    asked = (apptainer / "asked").read_text().splitlines()
    sources = digest_sources(source_root())
    for value in (
        "bootstrap=docker",
        "base=lab/python:3.11",
        f"version={throwcollect.__version__}",
        f"sources={sources}",
    ):
        assert asked[asked.index(value) - 1] == "--build-arg"
    assert asked[-1] == "docker/throwcollect.def"


def test_the_base_image_of_a_sif_may_be_a_file_or_a_directory(apptainer: Path, tmp_path: Path) -> None:
    (tmp_path / "base").mkdir()
    (tmp_path / "base.sif").write_bytes(SIF)
    (tmp_path / "base.tar").write_bytes(b"")
    for name, bootstrap in (("base", "localimage"), ("base.sif", "localimage"), ("base.tar", "docker-archive")):
        make(tmp_path / "it.sif", base=str(tmp_path / name))
        assert f"bootstrap={bootstrap}" in (apptainer / "asked").read_text().splitlines()


def test_making_a_sif_without_apptainer_and_singularity_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(WorkerError, match="neither apptainer nor singularity is installed"):
        make(tmp_path / "it.sif")


def test_a_sif_of_another_version_or_of_other_sources_is_refused(apptainer: Path, tmp_path: Path) -> None:
    sif = tmp_path / "it.sif"
    sif.write_bytes(SIF)
    own = {VERSION_LABEL: throwcollect.__version__, SOURCES_LABEL: digest_sources(source_root())}

    def write_inspection(labels: object) -> None:
        (apptainer / "inspected").write_text(
            json.dumps({"data": {"attributes": {"labels": labels}}, "type": "container"})
        )

    for labels in (own, {}, None, {SOURCES_LABEL: "unknown", VERSION_LABEL: "unknown"}):
        write_inspection(labels)
        check_sif(sif)
    write_inspection(own | {VERSION_LABEL: "0.0.9"})
    with pytest.raises(
        ConfigError, match=rf"holds throwcollect 0\.0\.9, and this is {throwcollect.__version__}"
    ) as caught:
        check_sif(sif)
    assert f"image sif -o {sif}" in str(caught.value.hint)
    write_inspection(own | {SOURCES_LABEL: "0" * 64})
    with pytest.raises(ConfigError, match="was made from other sources than these"):
        check_sif(sif)
    write_inspection(own)
    assert read_labels(sif)[VERSION_LABEL] == throwcollect.__version__
