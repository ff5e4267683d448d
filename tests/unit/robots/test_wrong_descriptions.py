"""A description with numbers that cannot be right is refused, instead of making a robot that nobody described."""

from pathlib import Path

import pytest

from throwcollect.errors import ConfigError
from throwcollect.robots.joint_model import joint_model
from throwcollect.robots.robot import Robot

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
        ("urdf", 'name="forearm_link"', 'name="upper_arm_link"', "link upper_arm_link is there twice"),
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
