"""The digest of a build covers engines and packages that have an effect on episodes."""

import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import pytest

from throwcollect import build


def compute_with(directory: Path, *packages: str, **parts: str) -> str:
    """Digest in a process that finds packages, named with their versions, of which each adds one part of its name."""
    for package in packages:
        family, name, given = package.split()
        info = directory / f"{name}-{given}.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {given}\n")
        (info / "entry_points.txt").write_text(f"[throwcollect.{family}]\n{name} = {name}:PART\n")
    code = "import sys; from throwcollect.build import build_digest; print(build_digest(**eval(sys.argv[1])))"
    arguments = [sys.executable, "-c", code, repr({"engine": "bullet", **parts})]
    environment = {**os.environ, "PYTHONPATH": str(directory)}
    return subprocess.run(arguments, env=environment, capture_output=True, text=True, check=True).stdout


def test_packages_that_the_configuration_does_not_name_are_no_part_of_the_build(tmp_path: Path) -> None:
    others = [
        f"{family} other_{family} 1.0" for family in ("robots", "tools", "engines", "tasks", "runtimes", "exporters")
    ]
    # A member of our own is taken even where another package uses its name.
    installed = compute_with(tmp_path / "all", *others, "engines bullet 1.0", "robots talos 1.0")
    assert installed == compute_with(tmp_path / "none")


@pytest.mark.parametrize("family", ["engine", "task"])
def test_the_version_of_a_package_that_the_configuration_names_is_a_part_of_the_build(
    family: str, tmp_path: Path
) -> None:
    versions = [[f"{family}s mine 1.0"], [f"{family}s mine 1.1"], [f"{family}s mine 1.0", "tools unrelated 3.0"]]
    first, later, beside = (
        compute_with(tmp_path / str(number), *packages, **{family: "mine"}) for number, packages in enumerate(versions)
    )
    assert first == beside
    assert first != later


def test_the_package_of_the_engine_that_computes_is_part_of_the_build_and_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bullet, mujoco = (build.build_digest.__wrapped__(name) for name in ("bullet", "mujoco"))
    assert bullet != mujoco
    assert [fact for fact in build._list_facts("mujoco") if "mujoco" in fact] == [
        f"mujoco-core {version('mujoco-core')}",
        *(fact for fact in build._list_facts("mujoco") if fact.startswith("mujoco ") and fact.endswith(" bytes")),
    ]
    monkeypatch.setattr(build, "version", lambda package: "9.9" if package == "mujoco-core" else version(package))
    assert build.build_digest.__wrapped__("bullet") == bullet
    assert build.build_digest.__wrapped__("mujoco") != mujoco


def test_another_compilation_of_an_engine_is_another_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mujoco").mkdir()
    (tmp_path / "mujoco" / "libmujoco.so.4").write_bytes(b"compiled")
    found = SimpleNamespace(origin=str(tmp_path / "mujoco" / "__init__.py"))
    monkeypatch.setattr(build, "find_spec", lambda _: found)
    assert "mujoco [8] bytes" in list(build._list_facts("mujoco"))
    monkeypatch.setattr(build, "find_spec", lambda _: None)
    assert "mujoco missing bytes" in list(build._list_facts("mujoco"))
