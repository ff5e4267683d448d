"""Properties of every tool in the table, and what is said about a tool of another package that lacks them."""

import math
from typing import Any

import numpy as np
import pytest

from throwcollect import members
from throwcollect.config.schema import Config
from throwcollect.config.tool_config import ToolConfig
from throwcollect.errors import MemberError
from throwcollect.members import load_member, names_of
from throwcollect.pinocchio_library import pinocchio
from throwcollect.tools.spoon.spoon import Spoon
from throwcollect.tools.tool import Box, tool_of

SECTIONS = [load_member("tools", name)() for name in names_of("tools")]
RADIUS_M = 0.025

of_every_tool = pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.name)


@of_every_tool
def test_a_tool_has_mass_and_size(section: ToolConfig) -> None:
    tool = tool_of(Config(tool=section))
    assert tool.name == section.name
    assert tool.link == f"{section.name}_link"
    assert tool.inertia.mass > 0
    assert tool.boxes
    assert min(tool.rim_radius_m, tool.depth_m) > 0


@of_every_tool
def test_a_ball_rests_above_the_boxes_and_stays_in_the_upright_cup(section: ToolConfig) -> None:
    tool = tool_of(Config(tool=section))
    seat = np.array(tool.ball_seat(RADIUS_M))
    for box in tool.boxes:
        inside = np.abs(box.placement.actInv(seat)) - np.array(box.size) / 2
        assert np.linalg.norm(np.maximum(inside, 0)) > RADIUS_M * 0.98
    safe = tool.way_out(RADIUS_M, np.array([1.0, 0.0, 0.0]))
    assert safe > 0
    assert tool.way_out(RADIUS_M, np.array([-1.0, 0.0, 0.0])) < 0


def fail(*_: object) -> Any:
    raise ValueError("boom")


def make_tool_of_another_package(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> None:
    """Make a spoon with these changes, as if it came from another package."""
    monkeypatch.setattr("throwcollect.tools.tool.is_own", lambda *_: False)
    monkeypatch.setattr(members, "_OWN", {**members._OWN, "tools": {}})
    monkeypatch.setattr(members, "entry_points", lambda **_: ())
    monkeypatch.setattr("throwcollect.tools.tool.load_part", lambda *_: type("Wrong", (Spoon,), changes))
    tool_of(Config())


def test_a_right_tool_of_another_package_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    make_tool_of_another_package(monkeypatch)
    make_tool_of_another_package(monkeypatch, ball_seat=lambda *_: Spoon(Config().tool).ball_seat(0.001))


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("name", 3, "name: should be 'spoon', is 3"),
        ("name", "scoop", "name: should be 'spoon', is 'scoop'"),
        ("mount", None, "mount: should be an instance of SE3, is None"),
        ("mount", property(fail), "ValueError: boom"),
        ("mount", pinocchio.SE3(2 * np.eye(3), np.zeros(3)), "mount.rotation: should be a rotation matrix, is"),
        ("mount", pinocchio.SE3(np.eye(3), np.full(3, math.nan)), "mount.translation.0: should be a finite number"),
        ("boxes", (), "boxes: Tuple should have at least 1 item"),
        (
            "boxes",
            (Box((0.1, -0.1, 0.1), pinocchio.SE3.Identity()),),
            "boxes.0.size.1: should be greater than 0, is -0.1",
        ),
        ("inertia", pinocchio.Inertia.Zero(), "inertia.mass: should be greater than 0, is 0.0"),
        (
            "inertia",
            pinocchio.Inertia(1.0, np.full(3, math.nan), np.eye(3)),
            "inertia.lever.0: should be a finite number, is nan",
        ),
        ("rim_radius_m", "wide", "rim_radius_m: should be a valid number, is 'wide'"),
        ("depth_m", math.nan, "depth_m: should be a finite number, is nan"),
        ("ball_seat", lambda *_: (0.0, math.nan, 0.0), "ball_seat.1: should be a finite number, is nan"),
        ("ball_seat", fail, "ValueError: boom"),
        (
            "way_out",
            lambda _tool, _radius, up: 1.0 if up[0] > 0 else None,
            "way_out: should be a valid number, is None",
        ),
    ],
)
def test_a_wrong_tool_of_another_package_is_an_error_that_says_what_would_be_right(
    name: str, value: Any, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(MemberError) as caught:
        make_tool_of_another_package(monkeypatch, **{name: value})
    assert str(caught.value).startswith("the tool spoon of ")
    assert said in str(caught.value)
