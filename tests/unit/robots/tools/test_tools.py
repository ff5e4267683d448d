"""Properties of every tool in the table."""

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.config.tool_config import ToolConfig
from throwcollect.members import load_member, names_of
from throwcollect.robots.tools.tool import Tool, tool_of

SECTIONS = [load_member("tools", name)() for name in names_of("tools")]
RADIUS_M = 0.025

HOLDING = [section for section in SECTIONS if section.name != "paddle"]

of_every_tool = pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.name)
of_every_tool_that_holds = pytest.mark.parametrize("section", HOLDING, ids=lambda section: section.name)


@of_every_tool
def test_a_tool_has_mass_and_size(section: ToolConfig) -> None:
    tool = tool_of(Config(tool=section))
    assert isinstance(tool, Tool)
    assert tool.name == section.name
    assert tool.link == f"{section.name}_link"
    assert tool.inertia.mass > 0
    assert tool.boxes
    assert min(edge for box in tool.boxes for edge in box.size) > 0


@of_every_tool
def test_the_numbers_of_a_tool_are_finite_and_its_rotations_are_rotations(section: ToolConfig) -> None:
    tool = tool_of(Config(tool=section))
    assert np.isfinite(tool.inertia.lever).all()
    assert np.linalg.eigvalsh(tool.inertia.inertia).min() > 0
    for pose in (tool.mount, *(box.placement for box in tool.boxes)):
        assert np.isfinite(pose.translation).all()
        assert pose.rotation @ pose.rotation.T == pytest.approx(np.eye(3), abs=1e-6)


@of_every_tool_that_holds
def test_a_tool_has_an_opening_and_ways_out(section: ToolConfig) -> None:
    tool = tool_of(Config(tool=section))
    assert min(tool.rim_radius_m, tool.depth_m) > 0
    for up in (*np.eye(3), *-np.eye(3)):
        assert np.isfinite(tool.way_out(RADIUS_M, up))


@of_every_tool_that_holds
def test_a_ball_rests_above_the_boxes_and_stays_in_the_upright_cup(section: ToolConfig) -> None:
    tool = tool_of(Config(tool=section))
    seat = np.array(tool.ball_seat(RADIUS_M))
    for box in tool.boxes:
        inside = np.abs(box.placement.actInv(seat)) - np.array(box.size) / 2
        assert np.linalg.norm(np.maximum(inside, 0)) > RADIUS_M * 0.98
    safe = tool.way_out(RADIUS_M, np.array([1.0, 0.0, 0.0]))
    assert safe > 0
    # A tool that holds the ball does so at any tilt.
    assert (tool.way_out(RADIUS_M, np.array([-1.0, 0.0, 0.0])) > 0) == (tool.release_s is not None)
