"""The table of runtimes, and what every runtime has to fulfil."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from tests.unit.collect.coordinator.listener import Listener

from throwcollect import extras, members
from throwcollect.collect.coordinator.reporter import SILENT
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.collect.runtimes.runtime import AUTOMATIC, Host, Runtime, choose, get_runtime
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.extras import MissingExtraError
from throwcollect.members import names_of
from throwcollect.ros.middleware import Middleware


class Cluster(Runtime):
    """A runtime of another package."""

    def describe(self, config: Config) -> str:
        return "a cluster"

    def host(self, record: RunRecord, config: Config, *, warn: Callable[[str], None]) -> Host:
        raise ConfigError("no cluster here")


@pytest.fixture
def added(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A package that adds the runtime `cluster`, as pip would have installed it."""
    package = tmp_path / "cluster-1.0.dist-info"
    package.mkdir()
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: cluster\nVersion: 1.0\n")
    (package / "entry_points.txt").write_text(f"[throwcollect.runtimes]\ncluster = {__name__}:Cluster\n")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    members._find_members.cache_clear()
    yield
    members._find_members.cache_clear()


def test_every_runtime_of_the_table_is_valid_in_a_configuration() -> None:
    assert names_of("runtimes") == ("local", "docker", "inprocess")
    assert set(AUTOMATIC) < set(names_of("runtimes"))
    for name in names_of("runtimes"):
        assert Config.model_validate({"run": {"runtime": name}}).run.runtime == name


def test_a_runtime_can_be_added_by_another_package(added: None, tmp_path: Path) -> None:
    assert type(get_runtime("cluster")).__name__ == "Cluster"
    config, listener = Config(), Listener()
    config = config.model_copy(update={"run": config.run.model_copy(update={"runtime": "cluster"})})
    assert choose(config, listener)[0] == "cluster"
    assert listener.said == ["runtime: a cluster"]


def test_a_configuration_can_name_a_runtime_of_another_package(added: None, tmp_path: Path) -> None:
    (tmp_path / "far.yaml").write_text("name: far\nrun: {runtime: cluster}\n")
    code = f"from throwcollect.config.loader import load; print(load({str(tmp_path / 'far.yaml')!r}).run.runtime)"
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    command, env = [sys.executable, "-c", code], {**os.environ, "PYTHONPATH": path}
    assert subprocess.run(command, env=env, check=True, capture_output=True, text=True).stdout == "cluster\n"


@pytest.mark.parametrize(("engine", "package"), [("bullet", "pybullet"), ("mujoco", "mujoco")])
@pytest.mark.parametrize("name", ["local", "inprocess"])
def test_a_missing_package_of_the_engine_is_an_error_before_nodes_start(
    name: str, engine: str, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extras, "is_installed", lambda each: each != package)
    middleware = Middleware("embedded", "zenoh")
    for each in ("bullet", "mujoco", "ballistic"):
        config = Config.model_validate({"sim": {"engine": each}})
        if each == engine:
            with pytest.raises(MissingExtraError, match=f"this needs {package}, which is not installed"):
                get_runtime(name).prepare(config, middleware, SILENT)
        else:
            assert get_runtime(name).prepare(config, middleware, SILENT) is middleware
