"""The digest of a build covers engines and packages that have an effect on episodes."""

from importlib.metadata import EntryPoint, EntryPoints, version
from pathlib import Path
from types import SimpleNamespace

import pytest

from throwcollect import build


def test_packages_that_add_members_are_part_of_the_build(monkeypatch: pytest.MonkeyPatch) -> None:
    before = build.build_digest.__wrapped__("bullet")
    points = EntryPoints([EntryPoint("free_fall", "lab:FreeFall", "throwcollect.engines"), EntryPoint("x", "y:z", "x")])
    monkeypatch.setattr(build, "entry_points", points.select)
    assert [fact for fact in build._list_facts("bullet") if "lab" in fact] == [
        "throwcollect.engines free_fall: lab:FreeFall of an unknown package"
    ]
    assert not [fact for fact in build._list_facts("bullet") if "y:z" in fact]
    assert build.build_digest.__wrapped__("bullet") != before


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
