from pathlib import Path

import pytest
from docker.models import containers as sdk

from throwcollect.config.containers import ContainerOptions, ContainersConfig
from throwcollect.config.loader import dump_yaml, load
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError

SOCKET = "is refused, as it is an engine's socket, and gives power over the host"
SYSTEM = "is refused, as {} belongs to the system; mounts are for data"
DEVICES = "is refused; containers get graphics processors alone: /dev/dri, /dev/nvidia*, /dev/kfd, /dev/dxg"
DEVICE = "should be HOST:CONTAINER:PERMISSIONS, such as /dev/dri:/dev/dri:rw"
NETWORK = "is refused; name a network of the engine, which is joined besides the run's own"
INSIDE = "is refused, as the dataset, the key or the image is there in the container"
PATHS = "should be HOST:CONTAINER or HOST:CONTAINER:ro with absolute paths"
UNKNOWN = "unknown key; known: hostname, domainname, dns, dns_search, dns_opt and 16 more"


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
  volume: null
  router: {ports: {80: 8080, 53/udp: 5353}}
  coordinator: {mounts: [/a:/b], options: {device_requests: [{driver: nvidia, count: -1, capabilities: [[gpu]]}]}}
  sim:
    cpus: 0.5
    memory: 512m
    cpuset: 0-3,6
    environment: {A: text, B: 1, C: 0.5}
    mounts: [/a:/b:ro]
    networks: [lab]
    options: {shm_size: 64m, ulimits: {nofile: 9}, dns: [1.1.1.1], tmpfs: {/cache: size=1m}, labels: {team: a}}
"""


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


def test_a_single_core_needs_no_quotes(tmp_path: Path) -> None:
    path = tmp_path / "run.yaml"
    path.write_text("containers: {sim: {cpuset: 0, options: {cpuset_mems: 1}}}")
    sim = load(path).containers.sim
    assert (sim.cpuset, sim.options["cpuset_mems"]) == ("0", "1")


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("sim: {memory: 512MB}", "sim.memory: should be a size of 6m or more, such as 512m or 2g, got '512MB'"),
        ("sim: {cpuset: 0-}", "sim.cpuset: should be numbers and ranges of cores, such as 0-3,6, got '0-'"),
        ("sim: {mounts: [a:/b]}", f"sim.mounts.0: {PATHS}, got 'a:/b'"),
        ("sim: {mounts: [/a]}", f"sim.mounts.0: {PATHS}, got '/a'"),
        ("sim: {mounts: [/a:/b:rw]}", f"sim.mounts.0: {PATHS}, got '/a:/b:rw'"),
        ("sim: {mounts: [/a/../run:/b]}", f"sim.mounts.0: {PATHS}, got '/a/../run:/b'"),
        ("sim: {mounts: [/run/docker.sock:/b]}", f"sim.mounts.0: /run/docker.sock {SOCKET}"),
        ("sim: {mounts: [/srv/x/podman.sock:/b]}", f"sim.mounts.0: /srv/x/podman.sock {SOCKET}"),
        ("sim: {mounts: [//:/b]}", f"sim.mounts.0: // {SYSTEM.format('/bin')}"),
        ("sim: {mounts: [///run/:/b]}", f"sim.mounts.0: ///run/ {SYSTEM.format('/run')}"),
        ("sim: {mounts: [/etc:/b:ro]}", f"sim.mounts.0: /etc {SYSTEM.format('/etc')}"),
        ("sim: {mounts: [/proc/1:/b]}", f"sim.mounts.0: /proc/1 {SYSTEM.format('/proc')}"),
        ("sim: {mounts: [/var/lib/docker/x:/b]}", f"sim.mounts.0: /var/lib/docker/x {SYSTEM.format('/var/lib')}"),
        ("sim: {mounts: [/var:/b]}", f"sim.mounts.0: /var {SYSTEM.format('/var/backups')}"),
        (
            "sim: {mounts: [/root:/b:ro]}",
            "sim.mounts.0: /root is refused, as a home directory holds secrets; mounts are for data",
        ),
        (
            "sim: {mounts: [/home/me/.ssh/id:/b:ro]}",
            "sim.mounts.0: /home/me/.ssh/id is refused, as .ssh may hold secrets of programs; mounts are for data",
        ),
        (
            "sim: {mounts: [/tmp/:/b]}",
            "sim.mounts.0: /tmp/ is refused, as all users of the machine share /tmp; mounts are for data",
        ),
        ("sim: {options: {devices: [/dev/vda:/dev/x:rw]}}", f"sim.options.devices.0: /dev/vda {DEVICES}"),
        ("sim: {options: {devices: [/dev/dri/../vda:/dev/x:rw]}}", f"sim.options.devices.0: /dev/dri/../vda {DEVICES}"),
        ("sim: {options: {devices: [/dev/mem:/dev/mem:r]}}", f"sim.options.devices.0: /dev/mem {DEVICES}"),
        (
            "sim: {options: {devices: [/dev/dri:/dev/dri:rwm]}}",
            f"sim.options.devices.0: {DEVICE}, got '/dev/dri:/dev/dri:rwm'",
        ),
        ("sim: {options: {devices: [/dev/dri]}}", f"sim.options.devices.0: {DEVICE}, got '/dev/dri'"),
        (
            "sim: {mounts: [/a:/data/b]}",
            "sim.mounts.0: /data/b is refused, as the dataset, the key or the image is there in the container",
        ),
        ("sim: {networks: [host]}", f"sim.networks.0: host {NETWORK}"),
        *(
            (f"sim: {{options: {{{option}}}}}", f"sim.options.{option.partition(':')[0]}: {UNKNOWN}")
            for option in ("privileged: true", "network_mode: host", "volumes: [/run/docker.sock]", "user: root")
        ),
        ("sim: {mounts: [/a://data]}", f"sim.mounts.0: //data {INSIDE}"),
        ("sim: {mounts: [/a://]}", f"sim.mounts.0: // {INSIDE}"),
    ],
)
def test_a_wrong_container_value_is_reported_with_file_line_and_key(tmp_path: Path, section: str, message: str) -> None:
    assert problems(tmp_path, f"containers:\n  {section}") == [f"run.yaml:2: containers.{message}"]


@pytest.mark.parametrize(
    "option",
    ["mounts: [/srv/models:/m:ro]", "mounts: [/home/me/data:/d]", "mounts: [/var/tmp/x:/x]", "mounts: [/tmpdata:/t]"]
    + [
        f"options: {{devices: [{device}:rw]}}"
        for device in ("/dev/dri:/dev/dri", "/dev/dri/renderD128:/dev/dri/renderD128", "/dev/nvidia0:/dev/nvidia0")
    ],
)
def test_mounts_of_data_and_graphics_devices_are_accepted(tmp_path: Path, option: str) -> None:
    path = tmp_path / "run.yaml"
    path.write_text(f"containers:\n  sim: {{{option}}}")
    load(path)


@pytest.mark.parametrize("option", ContainerOptions.__annotations__)
def test_every_container_option_is_a_keyword_of_the_docker_sdk(option: str) -> None:
    assert option in {*sdk.RUN_CREATE_KWARGS, *sdk.RUN_HOST_CONFIG_KWARGS}


def test_keys_of_containers_do_not_change_the_dataset() -> None:
    containers = ContainersConfig(image="other")
    assert Config(containers=containers).without_run() == Config()
