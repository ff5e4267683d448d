"""An imported robot moves, weighs and looks like the robot that its URDF describes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from tests.foreign_arm import ARM, BOX, CORNERS, FLANGE, dae, mesh, obj, stl, write_arm

from throwcollect.config.robot_config import DescribedRobotConfig
from throwcollect.config.schema import Config
from throwcollect.dataset.trajectories import name_components
from throwcollect.episode.frames import read_frames
from throwcollect.errors import ConfigError
from throwcollect.members import load_member
from throwcollect.robots.derived import Postures
from throwcollect.robots.description import full_description
from throwcollect.robots.imported import hash_files
from throwcollect.robots.importing import find_robot, find_urdf, import_robot
from throwcollect.robots.joint_model import joint_model
from throwcollect.robots.robot import Robot, joint_limits
from throwcollect.robots.urdf import read_xml
from throwcollect.state_directory import STATE_VARIABLE
from throwcollect.tasks.task import task_of

ARMS = ["panda", "ur5", "xarm7", "so101", "tiago"]
of_every_arm = pytest.mark.parametrize("name", ARMS)

TURN = '"turn" type="revolute"'
RANGE = 'lower="-2.5" upper="2.6" velocity="6" effort="150"'
FINGERS = """
<link name="finger_link"><inertial><origin xyz="0.01 0 0"/><mass value="0.2"/>
<inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>
<link name="thumb_link"/>
<joint name="grip" type="prismatic"><parent link="flange_link"/><child link="finger_link"/><axis xyz="0 1 0"/>
<limit lower="0.01" upper="0.05" velocity="1" effort="5"/></joint>
<joint name="follow" type="prismatic"><parent link="flange_link"/><child link="thumb_link"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" velocity="1" effort="5"/><mimic joint="grip" multiplier="-2" offset="0.003"/></joint>
</robot>"""


def find_section(path: Path, **keys: object) -> DescribedRobotConfig:
    return DescribedRobotConfig.model_validate({"urdf": str(path), "flange": FLANGE, **keys})


def describe(path: Path, **keys: object) -> Robot:
    return find_robot(find_section(path, **keys))


def hash_of(path: Path, **keys: object) -> str | None:
    return import_robot(find_section(path, **keys)).sha256


def read_original(path: Path) -> pinocchio.Model:
    return pinocchio.buildModelFromUrdf(str(path))


def place(model: pinocchio.Model, positions: Mapping[str, float]) -> np.ndarray:
    """Make a configuration, in which continuous joints have cosine and sine."""
    posture = pinocchio.neutral(model)
    for name, position in positions.items():
        joint = model.joints[model.getJointId(name)]
        values = [position] if joint.nq == 1 else [math.cos(position), math.sin(position)]
        posture[joint.idx_q : joint.idx_q + joint.nq] = values
    return posture


def find_frames(model: pinocchio.Model, positions: Mapping[str, float]) -> dict[str, np.ndarray]:
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, place(model, positions))
    return {
        frame.name: data.oMf[number].homogeneous
        for number, frame in enumerate(model.frames)
        if frame.type == pinocchio.BODY
    }


def draw(robot: Robot, count: int) -> Iterator[dict[str, float]]:
    """Draw postures within the limits."""
    limits, random = joint_limits(robot), np.random.default_rng(5)
    for _ in range(count):
        yield dict(zip(robot.joints, random.uniform(limits.lower, limits.upper).tolist(), strict=True))


def rest_of(model: pinocchio.Model, robot: Robot, fixed: Mapping[str, float]) -> dict[str, float]:
    """Positions of the joints that the import fixes: as given, else 0."""
    return {name: fixed.get(name, 0.0) for name in model.names[1:] if name not in robot.joints}


@of_every_arm
def test_links_of_a_built_in_arm_are_where_its_makers_put_them(name: str) -> None:
    robot, original = find_robot(name), read_original(find_urdf(load_member("robots", name).urdf))
    rest = rest_of(original, robot, load_member("robots", name).fixed)
    for positions in draw(robot, 100):
        expected = find_frames(original, {**rest, **positions})
        found = find_frames(joint_model(robot), positions)
        assert robot.hand in found
        for link, pose in found.items():
            assert np.allclose(pose, expected[link], rtol=0, atol=1e-9), (link, positions)


@of_every_arm
def test_masses_and_inertias_of_a_built_in_arm_are_conserved(name: str) -> None:
    robot, original = find_robot(name), read_original(find_urdf(load_member("robots", name).urdf))
    rest = rest_of(original, robot, load_member("robots", name).fixed)
    numbers = [original.getJointId(joint) for joint in rest]
    reduced, model = pinocchio.buildReducedModel(original, numbers, place(original, rest)), joint_model(robot)
    assert set(model.names) == set(reduced.names)
    for number, joint in enumerate(model.names):
        found, expected = model.inertias[number], reduced.inertias[reduced.getJointId(joint) if number else 0]
        assert found.mass == pytest.approx(expected.mass, rel=1e-9, abs=1e-12)
        assert np.allclose(found.lever, expected.lever, rtol=0, atol=1e-9)
        assert np.allclose(found.inertia, expected.inertia, rtol=0, atol=1e-9)
    assert sum(each.mass for each in model.inertias) == pytest.approx(sum(each.mass for each in original.inertias))


@of_every_arm
def test_an_arm_at_rest_is_clear_and_holds_the_ball(name: str) -> None:
    robot = find_robot(name)
    postures = Postures(robot)
    home = np.array([robot.rest_posture[joint] for joint in postures.joints])
    assert postures.list_overlapping(home) == []
    assert postures.find_uprightness(home) > math.cos(math.radians(15))
    pairs = [
        (each.get("link1", ""), each.get("link2", "")) for each in read_xml(robot.srdf_path).iter("disable_collisions")
    ]
    assert len({frozenset(pair) for pair in pairs}) == len(pairs) > 0
    assert {link for pair in pairs for link in pair} <= set(robot.description.links)


@pytest.mark.parametrize("links", ["link1='upper_link' link2='base_link'", "link1='base_link' link2='upper_link'"])
def test_links_of_an_srdf_may_overlap_in_either_order(links: str, tmp_path: Path) -> None:
    (tmp_path / "arm.srdf").write_text(f"<robot name='x'><disable_collisions {links} reason='Never'/></robot>")
    robot = describe(write_arm(tmp_path), srdf=str(tmp_path / "arm.srdf"))
    pairs = [(each.get("link1"), each.get("link2")) for each in read_xml(robot.srdf_path).iter("disable_collisions")]
    assert pairs.count(("base_link", "upper_link")) == 1
    geometry = Postures(robot).geometry
    shapes = [each.name[:5] for each in geometry.geometryObjects]
    checked = {frozenset((shapes[pair.first], shapes[pair.second])) for pair in geometry.collisionPairs}
    assert frozenset(("base_", "upper")) not in checked
    assert frozenset(("base_", "fore_")) in checked


@of_every_arm
def test_an_import_gives_the_same_files_again(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    section = load_member("robots", name)
    first = import_robot(section)
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path))
    again = import_robot(section)
    assert Path(again.urdf).is_relative_to(tmp_path)
    assert again.sha256 == first.sha256 == hash_files(Path(again.urdf).parent)
    Path(again.urdf).unlink()
    assert import_robot(section).sha256 == first.sha256


def test_an_imported_robot_can_be_imported_again(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(stl())
    once = import_robot(find_section(write_arm(tmp_path, (BOX, mesh("a.stl")))))
    keys = {key: getattr(once, key) for key in ("name", "urdf", "srdf", "flange", "controllers", "holding")}
    again = import_robot(DescribedRobotConfig.model_validate(keys))
    assert again.urdf != once.urdf
    assert (again.controllers, again.holding) == (once.controllers, once.holding)
    assert find_robot(again).rest_posture == find_robot(once).rest_posture
    assert find_robot(again).description.links.keys() == find_robot(once).description.links.keys()


def test_a_change_of_a_mesh_or_of_the_urdf_gives_another_hash(tmp_path: Path) -> None:
    path = write_arm(tmp_path, (BOX, mesh("a.stl")))
    (tmp_path / "a.stl").write_bytes(stl())
    first = hash_of(path)
    (tmp_path / "a.stl").write_bytes(stl(CORNERS * 1.01))
    second = hash_of(path)
    write_arm(tmp_path, (BOX, mesh("a.stl")), ('<mass value="2"/>', '<mass value="2.001"/>'))
    third = hash_of(path)
    assert len({first, second, third}) == 3
    (tmp_path / "a.stl").write_bytes(stl())
    write_arm(tmp_path, (BOX, mesh("a.stl")))
    assert hash_of(path) == first


def test_an_import_that_was_changed_afterwards_is_rejected(tmp_path: Path) -> None:
    section = import_robot(find_section(write_arm(tmp_path)))
    urdf = Path(section.urdf)
    text = urdf.read_text()
    try:
        urdf.write_text(text.replace('value="2"', 'value="3"').replace('value="2.0"', 'value="3.0"'))
        assert urdf.read_text() != text
        with pytest.raises(ConfigError, match=r"are not those of robot\.sha256"):
            _ = find_robot(section).description
    finally:
        urdf.write_text(text)


@pytest.mark.parametrize(("fixed", "grip", "follow"), [({}, 0.01, -0.017), ({"grip": 0.04}, 0.04, -0.077)])
def test_joints_without_a_controller_are_fixed_where_they_are_given_or_mimic(
    fixed: dict[str, float], grip: float, follow: float, tmp_path: Path
) -> None:
    path = write_arm(tmp_path, ("</robot>", FINGERS))
    robot, original = describe(path, fixed=fixed), read_original(path)
    assert robot.joints == ("turn", "lift", "bend")
    assert not robot.sliding
    for positions in draw(robot, 5):
        expected = find_frames(original, {**positions, "grip": grip, "follow": follow})
        for link, pose in find_frames(joint_model(robot), positions).items():
            assert np.allclose(pose, expected[link], rtol=0, atol=1e-9), link


def test_a_continuous_joint_turns_twice_as_far_as_a_circle(tmp_path: Path) -> None:
    path = write_arm(tmp_path, (TURN, '"turn" type="continuous"'), (RANGE, 'velocity="3" effort="70"'))
    robot, original = describe(path), read_original(path)
    limits = joint_limits(robot)
    assert (limits.lower[0], limits.upper[0]) == (-2 * math.pi, 2 * math.pi)
    assert (limits.velocity[0], limits.effort[0]) == (3, 70)
    for positions in draw(robot, 10):
        expected = find_frames(original, positions)
        for link, pose in find_frames(joint_model(robot), positions).items():
            assert np.allclose(pose, expected[link], rtol=0, atol=1e-9), link


def test_limits_of_the_section_replace_those_of_the_urdf(tmp_path: Path) -> None:
    limits = {"turn": {"min_position": -1, "max_effort": 9}, "bend": {"max_position": 2, "max_velocity": 1.5}}
    found = joint_limits(describe(write_arm(tmp_path), limits=limits))
    assert found.lower.tolist() == [-1, -2.5, -2.5]
    assert found.upper.tolist() == [2.6, 2.6, 2]
    assert found.velocity.tolist() == [6, 6, 1.5]
    assert found.effort.tolist() == [9, 150, 150]


def test_a_sliding_joint_has_metres_in_names_limits_and_frames(tmp_path: Path) -> None:
    path = write_arm(
        tmp_path,
        (TURN, '"turn" type="prismatic"'),
        (RANGE, 'lower="0.1" upper="0.4" velocity="1" effort="900"'),
        ('xyz="0 0 0.15"', 'xyz="0 0 0.15" rpy="0.4 -0.3 0.2"'),
    )
    section = import_robot(find_section(path, home={"turn": 0.2}))
    robot = find_robot(section)
    assert (section.prismatic, robot.sliding) == (["turn"], {"turn"})
    assert [robot.unit_of(joint) for joint in robot.joints] == ["m", "rad", "rad"]
    limits = joint_limits(robot)
    assert [each[0] for each in (limits.lower, limits.upper, limits.velocity, limits.effort)] == [0.1, 0.4, 1, 900]

    start = {"turn": 0.2, "lift": 0.0, "bend": 0.0}
    task = {"start": start, "end": {"turn": 0.3, "bend": 1.0}, "duration_s": 1.0}
    config = Config.model_validate({"robot": section, "task": task}, context=robot)
    columns = {
        quantity: name_components(f"joints_{quantity}", robot.joints, robot.sliding)[:2]
        for quantity in ("position", "velocity", "effort")
    }
    assert columns == {
        "position": ("turn_position_m", "lift_position_rad"),
        "velocity": ("turn_velocity_mps", "lift_velocity_radps"),
        "effort": ("turn_effort_n", "lift_effort_nm"),
    }
    names = [column.name for column in task_of(config).columns.columns if column.name.startswith(("turn_", "bend_"))]
    assert [name for name in names if name.startswith("turn_") and "rad" in name] == []
    assert {name for name in names if name.startswith("bend_") and "rad" in name}

    urdf = full_description(config)
    frame = next(each for each in read_frames(urdf, base_height=0.0).moving if each.joint == "turn")
    for positions in draw(robot, 20):
        poses = find_frames(pinocchio.buildModelFromXML(urdf), positions)
        inside = np.linalg.solve(poses[frame.parent], poses[frame.child])
        assert np.allclose(frame.translation_at(np.array([positions["turn"]]))[0], inside[:3, 3], atol=1e-12)
        assert frame.slides


@pytest.mark.parametrize("file", ["a.stl", "a.obj", "a.dae"])
@pytest.mark.parametrize("url", ["{file}", "file://{root}/arm/{file}", "package://arm/{file}", "{root}/arm/{file}"])
def test_a_mesh_is_found_by_every_kind_of_url_and_in_every_format(url: str, file: str, tmp_path: Path) -> None:
    path = write_arm(tmp_path / "arm", (BOX, mesh(url.format(root=tmp_path, file=file))))
    content = {"a.stl": stl(), "a.obj": obj().encode(), "a.dae": dae().encode()}[file]
    (tmp_path / "arm" / file).write_bytes(content)
    check_box(describe(path))


def check_box(robot: Robot) -> None:
    """Make sure that the collision shape of the upper arm is the box."""
    (shape,) = robot.description.links["upper_link"].shapes
    assert shape.mesh is not None
    assert shape.mesh.path.parent == robot.directory
    corners = np.unique((shape.mesh.triangles.reshape(-1, 3) * shape.size).round(6), axis=0)
    assert np.allclose(corners, np.unique(CORNERS, axis=0), atol=1e-6)


def to_key(root: Path, _monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    return {"packages": {"far_arm": str(root / "far_arm")}}


def to_ros(root: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    (root / "ros" / "share").mkdir(parents=True)
    (root / "far_arm").rename(root / "ros" / "share" / "far_arm")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{root / 'ros'}")
    return {}


@pytest.mark.parametrize("lead", [to_key, to_ros])
def test_a_package_is_found_where_the_section_or_ros_has_it(
    lead: Callable[[Path, pytest.MonkeyPatch], dict[str, object]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "far_arm" / "meshes").mkdir(parents=True)
    (tmp_path / "far_arm" / "meshes" / "a.stl").write_bytes(stl())
    keys = lead(tmp_path, monkeypatch)
    check_box(describe(write_arm(tmp_path / "near", (BOX, mesh("package://far_arm/meshes/a.stl"))), **keys))


def test_a_mesh_is_scaled_where_the_urdf_scales_it(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(stl(CORNERS * 1000))
    check_box(describe(write_arm(tmp_path, (BOX, mesh("a.stl", "0.001 0.001 0.001")))))


def test_a_name_that_no_robot_has_is_taken_from_the_urdf(tmp_path: Path) -> None:
    section = import_robot(find_section(write_arm(tmp_path)))
    assert ARM.startswith('<robot name="Foreign Arm">')
    assert (section.name, find_robot(section).name) == ("foreign_arm", "foreign_arm")
