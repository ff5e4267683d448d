"""A description with numbers that cannot be right is refused, instead of making a robot that nobody described."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError, MemberError
from throwcollect.robots import description
from throwcollect.robots.description import joint_model, physics_description
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
        ("urdf", '<mass value="2"/>', '<mass value="x"/>', "value of <mass> should be a mass of at least 0, is 'x'"),
        ("urdf", '<mass value="2"/>', '<mass value="-2"/>', "value of <mass> should be a mass of at least 0, is '-2'"),
        ("urdf", 'ixx="0.000833"', 'ixx="nan"', "ixx of <inertia> should be a finite number, is 'nan'"),
        ("urdf", 'size="0.3 0.04 0.04"', 'size="0.3 0.04"', "size of <box> should be 3 finite numbers, is '0.3 0.04'"),
        ("urdf", 'xyz="-0.5 0 0"', 'xyz="-0.5 0"', "xyz of <origin> should be 3 finite numbers, is '-0.5 0'"),
        (
            "urdf",
            'lower="-2.5" upper="2.5"',
            'lower="2.5" upper="-2.5"',
            "joint shoulder_joint: lower should be at most",
        ),
        (
            "urdf",
            'velocity="20"',
            'velocity="-20"',
            "velocity and effort not below 0: lower -2.5, upper 2.5, velocity -",
        ),
        ("urdf", 'effort="200"', 'effort="nan"', "velocity and effort not below 0: .* effort nan"),
        ("srdf", 'value="0.0"', 'value="nan"', "group_state rest: the angle of shoulder_joint is not finite"),
    ],
)
def test_a_number_that_cannot_be_right_is_named_and_refused(
    kind: str, old: str, new: str, said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ConfigError, match=said):
        joint_model(make_arm(tmp_path, kind, old, new))
    # The parser of URDF would print its own complaints to the terminal.
    assert capfd.readouterr().err == ""


def test_a_tool_with_the_name_of_a_link_or_the_ground_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ground", "torso_1"):
        tool = SimpleNamespace(name=name, link=f"{name}_link")
        monkeypatch.setattr(description, "tool_of", lambda _, tool=tool: tool)
        with pytest.raises(ConfigError, match=f"tool.name: the tool is recorded as {name}, .* has the name {name}"):
            physics_description(Config())


def test_a_function_that_does_not_find_the_files_is_named(tmp_path: Path) -> None:
    for share, said in ((lambda: 1 / 0, "ZeroDivisionError"), (lambda: str(tmp_path), "should be an instance of Path")):
        with pytest.raises(MemberError, match=f"the robot arm of .* cannot find its files: .*{said}"):
            _ = replace(make_arm(tmp_path), share=share).urdf_path
