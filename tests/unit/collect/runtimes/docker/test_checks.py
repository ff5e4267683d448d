"""The check that mounts and networks of a configuration exist and are allowed; links are followed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from tests.unit.collect.runtimes.docker.engine import Engine, engine_at

from throwcollect.collect.runtimes.docker.checks import check, find_secret
from throwcollect.collect.runtimes.docker.docker_engine import connect
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError

Check = Callable[..., list[str]]


@pytest.fixture
def engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Engine]:
    (tmp_path / "run").mkdir()
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/run/engine.sock")
    with engine_at(tmp_path / "run" / "engine.sock") as engine:
        engine.root = str(tmp_path / "engine")
        yield engine


@pytest.fixture
def problems(engine: Engine) -> Check:
    """The problems that the check finds in options of simulations."""

    def problems(**section: object) -> list[str]:
        config = Config.model_validate({"containers": {"image": "image", "sim": section}})
        with closing(connect()) as client:
            try:
                check(client, config)
            except ConfigError as error:
                return [str(problem).removeprefix("containers.sim.") for problem in error.problems]
        return []

    return problems


def test_a_data_directory_may_be_mounted(problems: Check, tmp_path: Path) -> None:
    (tmp_path / "models").mkdir()
    assert problems(mounts=[f"{tmp_path}/models:/models:ro"]) == []


@pytest.mark.parametrize("target", ["/data/episodes", "/key", "/", "/a/../data", "//data"])
def test_nothing_is_mounted_over_the_dataset_the_key_or_the_image(problems: Check, tmp_path: Path, target: str) -> None:
    (tmp_path / "models").mkdir()
    (found,) = problems(mounts=[f"{tmp_path}/models:/other", f"{tmp_path}/models:{target}"])
    assert found.startswith("mounts.1: /")
    assert found.endswith("is refused, as the dataset, the key or the image is there in the container")


@pytest.mark.parametrize("place", ["/etc", "/var/run", "/usr/share", "/"])
def test_mounting_a_link_to_a_part_of_the_system_is_refused(problems: Check, tmp_path: Path, place: str) -> None:
    (tmp_path / "link").symlink_to(place)
    found = problems(mounts=[f"{tmp_path}/link:/x:ro"])
    assert len(found) == 1
    assert found[0].startswith(f"mounts.0: {tmp_path}/link, which is {(tmp_path / 'link').resolve()}, is refused, as /")


def test_mounting_the_engine_secrets_or_missing_directories_is_refused(
    problems: Check, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("engine/volumes", "homes/me/data", "state/runs", "other"):
        (tmp_path / name).mkdir(parents=True)
    monkeypatch.setenv("HOME", str(tmp_path / "homes" / "me"))
    monkeypatch.setenv("THROWCOLLECT_STATE", str(tmp_path / "state"))
    homes = ["homes", "homes/me", "homes/me/data"]
    wanted = ["none", "engine", "engine/volumes", "run", "", *homes, "state/runs", "other", "run/engine.sock"]
    system = f"is refused, as {tmp_path}/{{}} belongs to the system; mounts are for data"
    assert problems(mounts=[f"{tmp_path}/{name}:/x{index}" for index, name in enumerate(wanted)]) == [
        f"mounts.0: {tmp_path}/none does not exist on this machine",
        f"mounts.1: {tmp_path}/engine {system.format('engine')}",
        f"mounts.2: {tmp_path}/engine/volumes {system.format('engine')}",
        f"mounts.3: {tmp_path}/run {system.format('run/engine.sock')}",
        f"mounts.4: {tmp_path} {system.format('engine')}",
        f"mounts.5: {tmp_path}/homes is refused, as a home directory holds secrets; mounts are for data",
        f"mounts.6: {tmp_path}/homes/me is refused, as a home directory holds secrets; mounts are for data",
        f"mounts.8: {tmp_path}/state/runs {system.format('state')}",
        f"mounts.10: {tmp_path}/run/engine.sock is refused, as it is a socket; mounts are for data",
    ]


def test_the_network_of_the_host_is_refused(problems: Check) -> None:
    assert problems(networks=["host"]) == ["networks.0: the Docker engine has no network host; create it first"]


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("/etc", "/etc belongs to the system"),
        ("/proc/1", "/proc belongs to the system"),
        ("/var/lib/docker/x", "/var/lib belongs to the system"),
        ("/var", "/var/backups belongs to the system"),
        ("/", "/bin belongs to the system"),
        ("/root", "a home directory holds secrets"),
        ("/home/me/.ssh/id", ".ssh may hold secrets of programs"),
        ("/tmp", "all users of the machine share /tmp"),
    ],
)
def test_directories_that_hold_no_data_are_refused(path: str, reason: str) -> None:
    assert find_secret(Path(path)) == reason


@pytest.mark.parametrize("path", ["/srv/models", "/home/me/data", "/var/tmp/x", "/tmpdata"])
def test_directories_of_data_are_accepted(path: str) -> None:
    assert find_secret(Path(path)) is None
