"""Properties of every tool in the table."""

import numpy as np
import pytest

from throwcollect.config.tool_config import ToolConfig
from throwcollect.members import load_member, names_of
from throwcollect.tools.tool import tool_of

SECTIONS = [load_member("tools", name)() for name in names_of("tools")]
RADIUS_M = 0.025

of_every_tool = pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.name)


@of_every_tool
def test_a_tool_has_mass_and_size(section: ToolConfig) -> None:
    tool = tool_of(section)
    assert tool.name == section.name
    assert tool.link == f"{section.name}_link"
    assert tool.inertia.mass > 0
    assert tool.boxes
    assert min(tool.rim_radius_m, tool.depth_m) > 0


@of_every_tool
def test_a_ball_rests_above_the_boxes_and_stays_in_the_upright_cup(section: ToolConfig) -> None:
    tool = tool_of(section)
    seat = np.array(tool.ball_seat(RADIUS_M))
    for box in tool.boxes:
        inside = np.abs(box.placement.actInv(seat)) - np.array(box.size) / 2
        assert np.linalg.norm(np.maximum(inside, 0)) > RADIUS_M * 0.98
    safe = tool.way_out(RADIUS_M, np.array([1.0, 0.0, 0.0]))
    assert safe > 0
    assert tool.way_out(RADIUS_M, np.array([-1.0, 0.0, 0.0])) < 0
