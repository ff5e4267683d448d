import os
import socket
from pathlib import Path
from typing import Any

import pytest

import throwcollect
from rclzenoh.session_config import client_override
from throwcollect.collect.runtimes.docker.container_options import choose_image, make_node_options, publishes_port
from throwcollect.collect.runtimes.docker.docker_engine import default_tag
from throwcollect.collect.runtimes.nodes import NodeRole, NodeSpec
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey

PLACE = RunRecord("throws-1a2b", Path("/home/me/data set"), Path("/logs"), 1, Middleware(), RunKey(Path("/state/key")))


def options(name: str, *, core: int | None = None, run: Any = None, **containers: Any) -> dict[str, Any]:
    config = Config.model_validate({"run": run or {}, "containers": containers}, strict=True)
    node = NodeSpec(name, ("command", "--option"), NodeRole.EXPENDABLE, core)
    return make_node_options(node, record=PLACE, config=config, image_id="sha256:12ab")


@pytest.mark.parametrize("name", ["router", "sim_0", "coordinator"])
def test_every_container_has_few_rights(name: str) -> None:
    made = options(name)
    assert (made["init"], made["read_only"], made["cap_drop"]) == (True, True, ["ALL"])
    assert made["security_opt"] == ["no-new-privileges"]
    assert made["tmpfs"] == {"/tmp": "rw,noexec,nosuid,size=64m"}
    assert made["pids_limit"] == 512
    assert made["user"] == f"{os.getuid()}:{os.getgid()}"
    assert made["log_config"]["Config"] == {"max-size": "10m", "max-file": "2"}
    assert made["ports"] == {}
    assert not {"privileged", "network_mode", "pid_mode", "ipc_mode", "restart_policy", "cap_add"} & set(made)


def test_a_container_gets_the_name_of_its_node_and_the_address_of_the_router() -> None:
    made = options("sim_3", run={"domain_id": 9})
    assert made["command"] == ["command", "--option"]
    assert (made["name"], made["network"]) == ("throwcollect-throws-1a2b-sim_3", "throwcollect-throws-1a2b")
    assert made["networking_config"]["throwcollect-throws-1a2b"]["Aliases"] == ["sim_3"]
    environment = made["environment"]
    assert (environment["THROWCOLLECT_NODE"], environment["ROS_DOMAIN_ID"]) == ("sim_3", "9")
    assert "tls/router:7447" in environment["ZENOH_CONFIG_OVERRIDE"]
    assert environment["THROWCOLLECT_HOST"] == socket.gethostname()
    assert environment["THROWCOLLECT_IMAGE"] == "sha256:12ab"
    assert environment["THROWCOLLECT_DIRECTORY"] == "/home/me/data set"
    assert made["labels"] == {
        "throwcollect.run": "throws-1a2b",
        "throwcollect.node": "sim_3",
        "throwcollect.directory": "/home/me/data set",
        "throwcollect.version": throwcollect.__version__,
    }


def test_only_the_coordinator_can_write_the_dataset_and_simulations_can_read_it() -> None:
    assert options("coordinator")["volumes"]["/home/me/data set"] == {"bind": "/data", "mode": "rw,z"}
    assert options("sim_0")["volumes"]["/home/me/data set"] == {"bind": "/data", "mode": "ro,z"}
    assert options("router")["volumes"].keys() == {"/state/key"}


def test_every_node_gets_the_key_of_the_run_in_a_read_only_mount() -> None:
    for name in ("router", "sim_0", "coordinator"):
        made = options(name)
        assert made["volumes"]["/state/key"] == {"bind": "/key", "mode": "ro,z"}
        assert made["environment"]["THROWCOLLECT_KEY"] == "/key"
        assert 'connect_private_key="/key/key.pem"' in made["environment"]["ZENOH_CONFIG_OVERRIDE"]


def test_nodes_of_an_open_run_connect_without_a_key_but_still_have_it() -> None:
    environment = options("sim_0", run={"open": True})["environment"]
    assert environment["ZENOH_CONFIG_OVERRIDE"] == client_override("tcp/router:7447")
    assert environment["THROWCOLLECT_KEY"] == "/key"


def test_a_simulation_is_bound_to_its_core_unless_the_configuration_binds_it() -> None:
    assert options("sim_1", core=3)["cpuset_cpus"] == "3"
    assert options("sim_1", core=3, sim={"cpuset": "0-1"})["cpuset_cpus"] == "0-1"
    assert options("sim_1", core=None)["cpuset_cpus"] is None


def test_container_options_of_simulations_do_not_apply_to_other_nodes() -> None:
    section = {"cpus": 1.5, "memory": "512m", "environment": {"ANSWER": 42}}
    made = options("sim_7", sim=section)
    assert (made["nano_cpus"], made["mem_limit"], made["memswap_limit"]) == (1_500_000_000, "512m", "512m")
    assert made["environment"]["ANSWER"] == "42"
    for name in ("router", "coordinator"):
        other = options(name, sim=section)
        assert (other["nano_cpus"], other["mem_limit"], other["environment"].get("ANSWER")) == (None, None, None)


def test_mounts_of_the_configuration_are_added_to_that_of_the_dataset() -> None:
    made = options("sim_0", sim={"mounts": ["/a b:/c:ro", "/d:/e:Z", "/f:/g"]})["volumes"]
    assert {source: made[source] for source in ("/a b", "/d", "/f")} == {
        "/a b": {"bind": "/c", "mode": "ro"},
        "/d": {"bind": "/e", "mode": "Z"},
        "/f": {"bind": "/g", "mode": "rw"},
    }


@pytest.mark.parametrize("source", ["/a b", "/home/me/data set"])
def test_no_mount_is_lost_that_has_the_source_of_another(source: str) -> None:
    with pytest.raises(ConfigError, match="is mounted twice, at /"):
        options("sim_0", sim={"mounts": [f"{source}:/c", "/a b:/d"]})


def test_ports_are_published_on_the_loopback_interface() -> None:
    made = options("router", run={"router_port": 7448}, router={"ports": {"80": 8080}})
    assert made["ports"] == {"80": ("127.0.0.1", 8080), "7447/tcp": ("127.0.0.1", 7448)}
    assert options("sim_0", run={"router_port": 7448})["ports"] == {}


def test_a_port_is_published_only_if_the_configuration_names_one() -> None:
    assert not publishes_port(Config())
    assert publishes_port(Config.model_validate({"run": {"router_port": 7448}}))
    assert publishes_port(Config.model_validate({"containers": {"coordinator": {"ports": {"80": 80}}}}))


def test_further_options_are_passed_on_but_never_replace_the_protections() -> None:
    further = {
        "shm_size": "64m",
        "pids_limit": 99,
        "labels": {"team": "a"},
        "ulimits": {"nofile": 256},
        "tmpfs": {"/tmp": "size=1g", "/cache": "size=1m"},
    }
    made = options("sim_0", sim={"options": further})
    assert (made["shm_size"], made["pids_limit"]) == ("64m", 99)
    assert made["labels"]["team"] == "a"
    assert made["labels"]["throwcollect.node"] == "sim_0"
    assert [(each["Name"], each["Soft"], each["Hard"]) for each in made["ulimits"]] == [("nofile", 256, 256)]
    assert made["tmpfs"] == {"/tmp": "rw,noexec,nosuid,size=64m,size=1g", "/cache": "size=1m"}
    assert (made["read_only"], made["cap_drop"]) == (True, ["ALL"])


def test_the_image_is_that_of_this_version_unless_the_configuration_names_another() -> None:
    assert choose_image(Config()) == default_tag()
    assert choose_image(Config.model_validate({"containers": {"image": "lab/throws:2"}})) == "lab/throws:2"
