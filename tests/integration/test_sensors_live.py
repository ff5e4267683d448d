"""What sensors see of a running simulation, and of what its clients record."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

import throwcollect
from tests.commands import Command
from tests.integration.robot import CONFIG, OWN, Robot, start_simulation, swing
from throwcollect.config.values import with_sensors
from throwcollect.dataset.verify import verify
from throwcollect.ros import Context, get_message

SEEN = with_sensors(
    CONFIG,
    {
        "side": {"kind": "camera", "width": 64, "height": 48, "rate_hz": 5},
        "scan": {"kind": "lidar_2d", "link": "base_link", "position_m": [0.4, 0, 0], "rate_hz": 5},
    },
)


@pytest.fixture
def seen(endpoint: str, session: Context, tmp_path: Path) -> Iterator[tuple[Robot, Command]]:
    process = start_simulation(tmp_path, endpoint, OWN, SEEN, options=("--record", str(tmp_path / "recorded")))
    robot = Robot(session, OWN)
    try:
        robot.wait_until_ready(process)
        yield robot, process
    finally:
        process.terminate()
        process.communicate()
    robot.wait_until_gone()
    robot.node.destroy_node()


def find_nodes(process: Command) -> list[psutil.Process]:
    return [each for each in psutil.Process(process.pid).children() if "sensors" in each.cmdline()]


def test_a_node_of_its_own_publishes_what_has_subscribers(seen: tuple[Robot, Command]) -> None:
    robot, process = seen
    names = robot.node.get_topic_names_and_types
    offered = {robot.topic(f"side/{name}") for name in ("image_raw", "camera_info")}
    robot.wait_until(lambda: offered <= {name for name, _ in names()}, "the topics of its sensors")
    assert find_nodes(process) == []
    pictures: list[Any] = []
    infos: list[Any] = []
    robot.node.create_subscription(
        get_message("sensor_msgs/msg/Image"), robot.topic("side/image_raw"), pictures.append, 10
    )
    robot.node.create_subscription(
        get_message("sensor_msgs/msg/CameraInfo"), robot.topic("side/camera_info"), infos.append, 10
    )
    robot.wait_until(lambda: bool(pictures and infos), "a picture of a robot that rests")
    [node] = find_nodes(process)
    assert (pictures[0].width, pictures[0].height, pictures[0].encoding) == (64, 48, "rgb8")
    assert len(np.unique(pictures[0].data)) > 20
    focal = infos[-1].k[0]

    parameter, value = (get_message(f"rcl_interfaces/msg/{name}") for name in ("Parameter", "ParameterValue"))

    def set_parameter(name: str, **typed: Any) -> Any:
        wanted = parameter(name=name, value=value(**typed))
        asked = robot.ask("rcl_interfaces/srv/SetParameters", "sensors/set_parameters", parameters=[wanted])
        return robot.result(asked).results[0]

    def set_view(angle_rad: float) -> Any:
        return set_parameter("sensors.side.vertical_fov_rad", type=3, double_value=angle_rad)

    def list_parameters() -> Any:
        asked = robot.ask("rcl_interfaces/srv/ListParameters", "sensors/list_parameters", prefixes=["sensors"])
        return robot.result(asked).result.names

    assert set_view(0.5).successful
    robot.wait_until(lambda: infos[-1].k[0] > 1.5 * focal, "the change in the next frame")
    assert "3.1" in set_view(4.0).reason
    robot.send(swing())
    robot.wait_until(lambda: pictures[-1].header.stamp.nanosec > 0, "a picture of an arm that moves")
    for wrong, reason in (('{"eye"', "JSON"), ("[]", "JSON"), ('{"eye": {"kind": "nose"}}', "sensors.eye.kind")):
        refused = set_parameter("sensors", type=4, string_value=wrong)
        assert (refused.successful, reason in refused.reason) == (False, True), refused.reason
    others = json.dumps({"eye": {"kind": "camera", "link": "head_2_link", "width": 32}})
    assert set_parameter("sensors", type=4, string_value=others).successful
    robot.wait_until(lambda: "sensors.eye.width" in list_parameters(), "the parameters of another sensor")
    assert not [name for name in list_parameters() if name.startswith("sensors.side.")]
    process.terminate()
    robot.wait_until(lambda: not node.is_running(), "it ends with its simulation")


def test_an_episode_that_a_client_records_has_frames(seen: tuple[Robot, Command], tmp_path: Path) -> None:
    robot, _ = seen
    robot.result(robot.ask("std_srvs/srv/SetBool", "record", data=True))
    robot.send(swing())
    robot.wait_until((tmp_path / "recorded" / "metadata.yaml").exists, "an episode is written")
    throw = throwcollect.load(tmp_path / "recorded")[0]
    assert len(throw.sensors["side"].images) == len(range(0, throw["samples"], CONFIG.record.rate_hz // 5))
    assert verify(tmp_path / "recorded") == []
