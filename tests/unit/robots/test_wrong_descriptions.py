"""A description with numbers that cannot be right is refused, instead of making a robot that nobody described."""

from pathlib import Path

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.robots.clearance import Clearance
from throwcollect.robots.joint_model import joint_model
from throwcollect.robots.robot import Robot
from throwcollect.tools.tool import tool_of

FILES = Path(__file__).parents[2] / "plugins" / "planar_arm"


def make_arm(directory: Path, kind: str = "", old: str = "", new: str = "") -> Robot:
    """The planar arm, with a change of its URDF or SRDF."""
    for suffix in ("urdf", "srdf"):
        text = (FILES / f"planar_arm.{suffix}").read_text()
        assert suffix != kind or old in text
        (directory / f"arm.{suffix}").write_text(text.replace(old, new, 1) if suffix == kind else text)
    return Robot(
        name="arm",
        title="the arm",
        controllers={"arm_controller": ("shoulder_joint", "elbow_joint")},
        share=lambda: directory,
        urdf="arm.urdf",
        srdf="arm.srdf",
        rest="rest",
        hand="hand_link",
    )


def test_the_unchanged_description_is_accepted(tmp_path: Path) -> None:
    assert joint_model(make_arm(tmp_path)).nq == 2


@pytest.mark.parametrize(
    ("kind", "old", "new", "said"),
    [
        ("urdf", '<mass value="2"/>', '<mass value="x"/>', "value of <mass> should be a finite number, is 'x'"),
        ("srdf", 'value="0.0"', 'value="nan"', "group_state rest: the angle of shoulder_joint is not finite"),
        ("urdf", 'name="forearm_link"', 'name="upper_arm_link"', "link upper_arm_link is there twice"),
        ("urdf", "</robot>", "<xacro:if/></robot>", "not well-formed XML: unbound prefix"),
    ],
)
def test_a_number_that_cannot_be_right_is_named_and_refused(
    kind: str, old: str, new: str, said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    arm = make_arm(tmp_path, kind, old, new)
    with pytest.raises(ConfigError, match=said):
        _ = joint_model(arm), arm.rest_posture
    # The parser of URDF would print its own complaints to the terminal.
    assert capfd.readouterr().err == ""


INERTIA = '<mass value="2"/><inertia ixx="{}" ixy="0" ixz="0" iyy="{}" iyz="0" izz="{}"/>'


def change_upper_arm(directory: Path, inertial: str, shape: str = "") -> Robot:
    """The planar arm with another inertia of its upper arm, and perhaps one more collision shape."""
    arm = make_arm(directory)
    text = arm.urdf_path.read_text()
    begin = text.index('<link name="upper_arm_link">')
    first, last = text.index("<inertial>", begin), text.index("</inertial>", begin) + len("</inertial>")
    arm.urdf_path.write_text(text[:first] + inertial + shape + text[last:])
    return arm


@pytest.mark.parametrize(
    ("inertial", "said"),
    [
        ("", "upper_arm_link, which shoulder_joint moves, has no mass"),
        (f"<inertial>{INERTIA.format(0.01, 0.01, 0.03)}</inertial>", "of 0.01, 0.01 and 0.03 kg m², which no body"),
    ],
)
def test_a_moving_link_without_a_possible_inertia_is_refused(inertial: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=said):
        joint_model(change_upper_arm(tmp_path, inertial))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('name="elbow_joint" type="revolute"', 'name="elbow_joint" type="continuous"', "elbow_joint is continuous"),
        ('name="hand_joint" type="fixed"', 'name="hand_joint" type="continuous"', r"hand_joint \(continuous\)"),
        (
            'name="elbow_joint" type="revolute">',
            'name="elbow_joint" type="revolute"><mimic joint="x"/>',
            "elbow_joint mimics x",
        ),
    ],
)
def test_a_joint_that_cannot_be_commanded_is_refused_with_its_kind(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=said):
        joint_model(make_arm(tmp_path, "urdf", old, new))


CORNERS = np.array([(x, y, z) for x in (-0.2, 0.2) for y in (-0.02, 0.02) for z in (-0.02, 0.02)])
HULL = CORNERS[np.array([(0, 1, 2), (3, 2, 1), (4, 5, 6), (7, 6, 5), (0, 4, 1), (5, 1, 4), (2, 3, 6), (7, 6, 3)])]


def write_text_stl(path: Path, triangles: np.ndarray) -> None:
    vertices = ("".join(f"vertex {x} {y} {z}\n" for x, y, z in each) for each in triangles)
    facets = "".join(f"facet normal 0 0 1\nouter loop\n{each}endloop\nendfacet\n" for each in vertices)
    path.write_text(f"solid x\n{facets}endsolid x\n")


def add_mesh(directory: Path, url: str, scale: str = "1 1 1") -> Robot:
    inertial = f"<inertial>{INERTIA.format(0.01, 0.02, 0.02)}</inertial>"
    mesh = f'<collision><geometry><mesh filename="{url}" scale="{scale}"/></geometry></collision>'
    return change_upper_arm(directory, inertial, mesh)


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("arm.ply", r"link upper_arm_link: .*arm.ply: collision meshes of this format cannot be read"),
        ("none.stl", r"link upper_arm_link: .*none.stl: .*No such file"),
        ("flat.stl", "link upper_arm_link: .*flat.stl: the mesh is flat"),
    ],
)
def test_a_mesh_that_cannot_be_used_is_refused_with_its_link(
    url: str, said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    write_text_stl(tmp_path / "flat.stl", HULL * (1, 1, 0))
    (tmp_path / "arm.ply").write_text("ply")
    arm = add_mesh(tmp_path, url)
    with pytest.raises(ConfigError, match=said):
        Clearance(arm, joint_model(arm), tool_of(Config()))
    assert capfd.readouterr() == ("", "")
