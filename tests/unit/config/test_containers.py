"""Keys of containers, and what their patterns accept."""

from pathlib import Path

import pytest
from docker.models import containers as sdk

from throwcollect.config.loader import dump_yaml, load
from throwcollect.config.run import ContainerOptions, ContainersConfig
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError


def problems(tmp_path: Path, text: str) -> list[str]:
    path = tmp_path / "run.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"\S") as caught:
        load(path)
    return [str(problem).replace(f"{tmp_path}/", "") for problem in caught.value.problems]


FULL = """\
run: {simulations: 1, runtime: docker}
containers:
  image: lab/throws:2
  router: {ports: {80: 8080, 53/udp: 5353}}
  coordinator: {mounts: [/a:/b], options: {gpus: -1}}
  sim:
    cpus: 0.5
    memory: 512m
    cpuset: 0-3,6
    environment: {A: text, B: 1, C: 0.5}
    mounts: [/a:/b:ro, /c:/d:z, "/e:/f:ro,Z"]
    networks: [lab]
    options: {shm_size: 64m, ulimits: {nofile: 9}, dns: [1.1.1.1], tmpfs: {/cache: size=1m}, labels: {team: a}}
"""
WRONG_MOUNTS = ("a:/b", "/a", "//:/b", "/a:/b:rz")


def test_every_container_key_reads_back_equal_after_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "run.yaml"
    path.write_text(FULL)
    config = load(path)
    assert config.containers.sim.environment == {"A": "text", "B": 1, "C": 0.5}
    assert config.containers.router.ports == {"80": 8080, "53/udp": 5353}
    assert config.containers.sim.options["ulimits"] == {"nofile": 9}
    again = tmp_path / "again.yaml"
    again.write_text(dump_yaml(config))
    assert load(again) == config


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("sim: {memory: 512MB}", "sim.memory: should match pattern"),
        *(
            (f"sim: {{mounts: ['{mount}']}}", "sim.mounts.0: should match pattern")
            for mount in ("a:/b", "/a", "//:/b", "/a:/b:rz")
        ),
        ("sim: {options: {devices: [/dev/vda:rw]}}", "sim.options.devices.0: should match pattern"),
        *(
            (f"sim: {{options: {{{option}}}}}", f"sim.options.{option.partition(':')[0]}: unknown key; known: dns, ")
            for option in ("privileged: true", "network_mode: host", "volumes: [/run/docker.sock]", "user: root")
        ),
    ],
)
def test_a_wrong_container_value_is_reported_with_file_line_and_key(tmp_path: Path, section: str, message: str) -> None:
    (found,) = problems(tmp_path, f"containers:\n  {section}")
    assert found.startswith(f"run.yaml:2: containers.{message}")


@pytest.mark.parametrize("option", sorted({*ContainerOptions.__annotations__} - {"gpus"}))
def test_every_container_option_is_a_keyword_of_the_docker_sdk(option: str) -> None:
    assert option in {*sdk.RUN_CREATE_KWARGS, *sdk.RUN_HOST_CONFIG_KWARGS}


def test_keys_of_containers_do_not_change_the_dataset() -> None:
    containers = ContainersConfig(image="other")
    assert Config(containers=containers).without_run() == Config()
