"""Spawning and deleting entities in a simulation, and their effect on throws."""

import hashlib
from pathlib import Path
from typing import Any

import pytest

from tests.integration.robot import ARM, PAUSED, Result, Robot, swing
from tests.unit.sim.bodies import box
from throwcollect.ros import get_message, get_service

Spawn: Any = get_service("simulation_interfaces/srv/SpawnEntity").Response
SpawnEntities: Any = get_service("simulation_interfaces/srv/SpawnEntities").Response
Reset: Any = get_service("simulation_interfaces/srv/ResetSimulation").Request
SpawnRequest: Any = get_message("simulation_interfaces/msg/SpawnEntity")
PoseStamped: Any = get_message("geometry_msgs/msg/PoseStamped")
EntityState: Any = get_message("simulation_interfaces/msg/EntityState")
EntityCategory: Any = get_message("simulation_interfaces/msg/EntityCategory")
PANDA = "package://example-robot-data/robots/panda_description/urdf/panda.urdf"


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0, *, w: float = 1.0, frame: str = "") -> Any:
    stamped = PoseStamped()
    stamped.header.frame_id = frame
    stamped.pose.position.x, stamped.pose.position.y, stamped.pose.position.z = x, y, z
    stamped.pose.orientation.w = w
    return stamped


def spawn(robot: Robot, name: str = "crate", **fields: Any) -> Any:
    request = {"resource_string": box(), "initial_pose": pose(2.0, 2.0, 0.1), **fields}
    return robot.call("spawn_entity", name=name, **request)


def spawn_successfully(robot: Robot, name: str = "crate", **fields: Any) -> str:
    response = spawn(robot, name, **fields)
    assert response.result.result == Result.RESULT_OK, response.result.error_message
    return str(response.entity_name)


def entities(robot: Robot) -> list[str]:
    return list(robot.call("get_entities").entities)


def height(robot: Robot, name: str) -> float:
    return float(robot.call("get_entity_state", entity=name).state.pose.position.z)


def episode(robot: Robot, scope: int = Reset.SCOPE_DEFAULT) -> str:
    """Digest of a trial as a collection runs it."""
    assert robot.set({"trial.number": 7, "trial.controllers": [ARM]}).successful
    with robot.listening("std_msgs/msg/UInt8MultiArray", "episode") as heard:
        assert robot.call("reset_simulation", scope=scope).result.result == Result.RESULT_OK
        assert robot.send(swing()).accepted
        robot.wait_until(lambda: bool(heard), "the episode")
    return hashlib.sha256(bytes(heard[0].data)).hexdigest()


def test_a_spawned_body_falls_to_the_ground_and_stays_on_it(robot: Robot) -> None:
    robot.put_into(PAUSED)
    assert spawn_successfully(robot, initial_pose=pose(2.0, 2.0, 0.5)) == "crate"
    assert entities(robot) == ["ball", "talos", "crate"]
    robot.step(50)
    assert height(robot, "crate") == pytest.approx(0.5 - 9.81 * 0.1**2 / 2, abs=2e-3)
    robot.step(450)
    assert height(robot, "crate") == pytest.approx(0.1, abs=2e-3)


def test_the_ball_lands_on_a_spawned_table(robot: Robot) -> None:
    robot.put_into(PAUSED)
    assert (
        spawn_successfully(robot, "table", resource_string=box("0.5 0.5 1.0", mass=0), initial_pose=pose(2.0, 2.0, 0.5))
        == "table"
    )
    state = EntityState()
    state.pose.position.x, state.pose.position.y, state.pose.position.z = 2.0, 2.0, 1.2
    assert robot.call("set_entity_state", entity="ball", state=state).result.result == Result.RESULT_OK
    robot.step(500)
    assert height(robot, "ball") == pytest.approx(1.025, abs=2e-3)
    assert height(robot, "table") == 0.5


def test_a_taken_name_is_refused_unless_renaming_is_allowed(robot: Robot) -> None:
    assert spawn_successfully(robot) == "crate"
    refused = spawn(robot)
    assert refused.result.result == Spawn.NAME_NOT_UNIQUE
    assert refused.entity_name == ""
    assert spawn_successfully(robot, allow_renaming=True) == "crate_1"
    assert spawn_successfully(robot, allow_renaming=True) == "crate_2"
    assert spawn(robot, "ball").result.result == Spawn.NAME_NOT_UNIQUE
    assert spawn_successfully(robot, "ball", allow_renaming=True) == "ball_1"
    assert (
        spawn_successfully(robot, "", resource_string=box(name="from the file"), allow_renaming=True) == "from_the_file"
    )
    assert entities(robot) == ["ball", "talos", "crate", "crate_1", "crate_2", "ball_1", "from_the_file"]


@pytest.mark.parametrize(
    ("fields", "code", "words"),
    [
        ({"name": ""}, Spawn.NAME_INVALID, "name ''"),
        ({"name": "a/b"}, Spawn.NAME_INVALID, "name 'a/b'"),
        ({"name": "world"}, Spawn.NAME_INVALID, "other than world"),
        ({"name": "x" * 10**6}, Spawn.NAME_INVALID, "1 to 100 letters"),
        ({"name": "a b", "allow_renaming": True}, Spawn.NAME_INVALID, "name 'a b'"),
        ({"entity_namespace": "/a//b"}, Spawn.NAMESPACE_INVALID, "namespace '/a//b'"),
        ({"entity_namespace": "1st"}, Spawn.NAMESPACE_INVALID, "such as /left/table"),
        ({"initial_pose": pose(w=0.0)}, Spawn.INVALID_POSE, "norm 0"),
        ({"initial_pose": pose(float("nan"))}, Spawn.INVALID_POSE, "nan"),
        ({"initial_pose": pose(1e30)}, Spawn.INVALID_POSE, "within 1000 m"),
        ({"initial_pose": pose(frame="table")}, Spawn.INVALID_POSE, "no frame 'table'"),
        ({"resource_string": ""}, Spawn.NO_RESOURCE, "neither"),
        ({"uri": "file:///nowhere/table.urdf"}, Result.RESULT_NOT_FOUND, "/nowhere/table.urdf"),
        ({"uri": "file:///etc/passwd"}, Spawn.UNSUPPORTED_FORMAT, "*.urdf"),
        ({"uri": "package://nothing/table.urdf"}, Result.RESULT_NOT_FOUND, "no such package"),
        ({"uri": "https://example.com/table.urdf"}, Spawn.UNSUPPORTED_FORMAT, "unknown kind of URL"),
        ({"resource_string": "<sdf version='1.7'/>"}, Spawn.UNSUPPORTED_FORMAT, "SDFormat"),
        ({"resource_string": "<robot>\n<link name='a'>\n</robot>"}, Spawn.RESOURCE_PARSE_ERROR, "line 3"),
        (
            {"resource_string": box("0.1 nan 0.1")},
            Spawn.RESOURCE_PARSE_ERROR,
            "size of <box> should be 3 finite numbers",
        ),
        (
            {"resource_string": box().replace("<box", '<mesh filename="file:///nowhere/cup.stl"/><box')},
            Spawn.MISSING_ASSETS,
            "/nowhere/cup.stl",
        ),
        (
            {"resource_string": box().replace("<box", '<mesh filename="file:///etc/passwd"/><box')},
            Spawn.UNSUPPORTED_ASSETS,
            ".stl or .obj or .dae",
        ),
    ],
)
def test_invalid_spawn_requests_are_refused_with_their_codes(
    fields: dict[str, Any], code: int, words: str, robot: Robot
) -> None:
    refused = spawn(robot, **{"name": "crate", **fields}).result
    assert refused.result == code, refused.error_message
    assert words in refused.error_message
    assert len(refused.error_message) < 1000
    assert entities(robot) == ["ball", "talos"]


def test_an_entity_bomb_and_huge_descriptions_are_refused(robot: Robot) -> None:
    entity = "".join(f'<!ENTITY e{n + 1} "{f"&e{n};" * 10}">' for n in range(9))
    bomb = f'<!DOCTYPE robot [<!ENTITY e0 "boom">{entity}]><robot name="&e9;"/>'
    deep = "<robot>" + "<link>" * 200_000 + "</link>" * 200_000 + "</robot>"
    long = "<robot>" + " " * 5_000_000 + "</robot>"
    for text, words in ((bomb, "document type"), (deep, "a link has the name ''"), (long, "5000015 characters")):
        refused = spawn(robot, resource_string=text).result
        assert refused.result == Spawn.RESOURCE_PARSE_ERROR
        assert words in refused.error_message
    assert spawn_successfully(robot) == "crate"


def test_a_robot_spawned_from_its_package_has_the_category_robot(robot: Robot) -> None:
    spawnables = robot.call("get_spawnables")
    assert spawnables.result.result == Result.RESULT_OK
    assert {PANDA, "package://example-robot-data/robots/talos_data/robots/talos_reduced.urdf"} <= {
        each.uri for each in spawnables.spawnables
    }
    assert spawn_successfully(robot, "arm", uri=PANDA, entity_namespace="/left") == "arm"
    info = robot.call("get_entity_info", entity="arm").info
    assert info.category.category == EntityCategory.CATEGORY_ROBOT
    assert info.description == f"URDF 'panda' of {PANDA}, namespace /left"


def test_get_spawnables_searches_the_requested_sources(robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "good.urdf").write_text(box(name="a crate"))
    (tmp_path / "torn.urdf").write_text("<robot")
    (tmp_path / "mesh.urdf").write_text(box().replace("<box", '<mesh filename="missing.stl"/><box'))
    sources = [tmp_path.as_uri(), "file:///nowhere", "magic"]
    response = robot.call("get_spawnables", sources=sources)
    assert response.result.result == Result.RESULT_OK
    assert "'file:///nowhere': no such directory" in response.result.error_message
    assert "'magic': unknown kind of URL" in response.result.error_message
    own = [each for each in response.spawnables if each.uri.startswith(tmp_path.as_uri())]
    assert [(each.uri, each.description) for each in own] == [((tmp_path / "good.urdf").as_uri(), "a crate")]
    assert spawn_successfully(robot, uri=own[0].uri) == "crate"


def test_a_pose_may_be_given_in_the_frame_of_a_spawned_entity(robot: Robot) -> None:
    first = pose(1.0, 1.0, 0.5)
    first.pose.orientation.z, first.pose.orientation.w = 0.5**0.5, 0.5**0.5
    spawn_successfully(robot, "table", resource_string=box(mass=0), initial_pose=first)
    spawn_successfully(robot, "cup", initial_pose=pose(0.25, 0.0, 0.5, frame="table"))
    there = robot.call("get_entity_state", entity="cup").state.pose
    assert (there.position.x, there.position.y, there.position.z) == pytest.approx((1.0, 1.25, 1.0), abs=1e-6)
    assert there.orientation.z == pytest.approx(0.5**0.5, abs=1e-6)


def test_each_of_many_spawn_requests_has_its_own_result(robot: Robot) -> None:
    def wish(name: str, text: str) -> Any:
        request = SpawnRequest(name=name, initial_pose=pose(3.0, 0.0, 1.0))
        request.entity_resource.resource_string = text
        return request

    wishes = [wish("one", box()), wish("one", box()), wish("two", "<robot"), wish("three", box(mass=0))]
    response = robot.call("spawn_entities", spawn_requests=wishes)
    assert response.result.result == SpawnEntities.ENTITIES_SPAWN_FAILED
    assert response.result.error_message.startswith("2 of 4")
    codes = [(int(each.result.result), each.entity_name) for each in response.results]
    assert codes == [
        (Result.RESULT_OK, "one"),
        (Spawn.NAME_NOT_UNIQUE, ""),
        (Spawn.RESOURCE_PARSE_ERROR, ""),
        (Result.RESULT_OK, "three"),
    ]
    assert robot.call("spawn_entities").result.result == Result.RESULT_OK
    robot.reset()
    crowd = [wish(f"crate_{number}", box()) for number in range(201)]
    refused = robot.call("spawn_entities", spawn_requests=crowd)
    assert refused.result.error_message == "201 requests in one call; at most 200"
    assert robot.call("spawn_entities", spawn_requests=crowd[:200]).result.result == Result.RESULT_OK
    assert "there is no room" in spawn(robot).result.error_message


def test_a_fixed_entity_can_be_placed_but_not_set_in_motion(robot: Robot) -> None:
    spawn_successfully(robot, resource_string=box(mass=0))
    state = EntityState()
    state.pose.position.z = 3.0
    assert robot.call("set_entity_state", entity="crate", state=state).result.result == Result.RESULT_OK
    state.twist.angular.z = 1.0
    assert robot.call("set_entity_state", entity="crate", state=state).result.result == Result.RESULT_OPERATION_FAILED
    state.twist.angular.z, state.acceleration.linear.x = 0.0, 1.0
    assert robot.call("set_entity_state", entity="crate", state=state).result.result == Result.RESULT_OPERATION_FAILED
    robot.put_into(PAUSED)
    robot.step(10)
    assert height(robot, "crate") == 3.0
    info = robot.call("get_entity_info", entity="crate").info
    assert info.category.category == EntityCategory.CATEGORY_STATIC_OBJECT


def test_a_spawned_entity_can_be_deleted_once(robot: Robot) -> None:
    spawn_successfully(robot)
    assert robot.call("delete_entity", entity="crate").result.result == Result.RESULT_OK
    assert robot.call("delete_entity", entity="crate").result.result == Result.RESULT_NOT_FOUND
    assert entities(robot) == ["ball", "talos"]
    assert spawn_successfully(robot) == "crate"


def test_a_reset_of_spawned_entities_leaves_time_and_ball(robot: Robot) -> None:
    robot.put_into(PAUSED)
    spawn_successfully(robot)
    robot.step(100)
    now, ball = robot.now_ns(), height(robot, "ball")
    assert robot.call("reset_simulation", scope=Reset.SCOPE_SPAWNED).result.result == Result.RESULT_OK
    assert entities(robot) == ["ball", "talos"]
    assert robot.now_ns() == now > 0
    assert height(robot, "ball") == ball


def test_a_reset_of_time_and_state_moves_spawned_entities_back(robot: Robot) -> None:
    robot.put_into(PAUSED)
    spawn_successfully(robot, initial_pose=pose(2.0, 2.0, 1.0))
    robot.step(100)
    assert height(robot, "crate") < 0.9
    assert robot.call("reset_simulation", scope=Reset.SCOPE_TIME | Reset.SCOPE_STATE).result.result == Result.RESULT_OK
    assert entities(robot) == ["ball", "talos", "crate"]
    assert height(robot, "crate") == 1.0
    assert robot.now_ns() == 0


def test_spawned_entities_change_their_trial_and_no_later_one(robot: Robot) -> None:
    alone = episode(robot)
    assert episode(robot) == alone
    # Both entities are in the way of the arm or of the ball.
    spawn_successfully(robot, "wall", resource_string=box("0.1 3.0 4.0", mass=0), initial_pose=pose(0.9, 0.0, 0.0))
    spawn_successfully(robot, "crate", initial_pose=pose(0.5, -0.4, 1.6))
    among = episode(robot, Reset.SCOPE_TIME | Reset.SCOPE_STATE)
    assert among != alone
    assert episode(robot, Reset.SCOPE_TIME | Reset.SCOPE_STATE) == among
    assert episode(robot) == alone
    assert entities(robot) == ["ball", "talos"]
    spawn_successfully(robot, "crate", initial_pose=pose(0.5, -0.4, 1.6))
    assert robot.call("delete_entity", entity="crate").result.result == Result.RESULT_OK
    assert episode(robot, Reset.SCOPE_TIME | Reset.SCOPE_STATE) == alone
