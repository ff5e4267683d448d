"""A starter configuration is complete, names what is installed, and overwrites no file."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tests.unit.plan.own_plan import make_plan

from throwcollect.cli.show import init
from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.config.loader import load
from throwcollect.errors import ConfigError
from throwcollect.tasks.starter import begin_at_default, write_starter


def test_the_starter_gives_a_plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    init()
    config = load(DEFAULT_CONFIG)
    assert len(make_plan(config).trials) == config.trials


@pytest.mark.parametrize(("there", "engine"), [(True, "bullet"), (False, "mujoco")])
def test_a_starter_names_mujoco_where_bullet_has_no_wheel(
    there: bool, engine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("throwcollect.tasks.starter.has_wheel", lambda _package: there)
    path = tmp_path / "throws.yaml"
    path.write_text(write_starter("throw", begin_at_default("talos", "throw")))
    assert load(path).sim.engine == engine


def test_init_does_not_overwrite_an_existing_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    DEFAULT_CONFIG.write_text("mine")
    with pytest.raises(ConfigError, match=r"throwcollect\.yaml: is there already"):
        init()
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]


def test_a_starter_explains_the_keys_of_its_task() -> None:
    text = write_starter("throw", begin_at_default("talos", "throw"))
    meaning = "The ball counts as released when it has been out of the spoon for this long"
    assert f"  recatch_gap_s: 0.02 # {meaning}\n" in text


@pytest.mark.parametrize(
    ("robot", "task", "said"),
    [
        ("my.urdf", "throw", "my.urdf: no such robot is installed; known: talos, .*\n.*docs/robots.md"),
        ("talos", "juggle", "--task juggle: no such task is installed; known: .*throw.*; docs/robots.md describes"),
    ],
)
def test_an_unknown_robot_or_task_is_an_error_with_the_known_ones(robot: str, task: str, said: str) -> None:
    # Other tests of the same process may have made further packages known.
    with pytest.raises(ConfigError) as caught:
        init(robot=robot, task=task)
    assert re.match(said, str(caught.value))
