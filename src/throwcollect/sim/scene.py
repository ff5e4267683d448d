"""Turns a configuration into values for a physics engine."""

from __future__ import annotations

import math

from throwcollect.config.scene import BALL
from throwcollect.config.schema import Config
from throwcollect.engines.body import Vector
from throwcollect.engines.engine import Physics, Scene, ToolLink
from throwcollect.robots.description import Description, robot_of
from throwcollect.robots.robot import joint_limits
from throwcollect.robots.surroundings import bodies_of, object_of, starts_in_tool
from throwcollect.robots.tools.tool import tool_of

_OPENING = (1.0, 0.0, 0.0)
"""Direction in which every tool is open, in the frame of its link."""


def scene_of(config: Config, description: Description) -> Scene:
    """Describe the world of a trial, with the robot of a description."""
    tool = tool_of(config)
    holds = tool.release_s is not None and starts_in_tool(config)
    return Scene(
        robot=description.model,
        moving=description.moving,
        base_height_m=config.robot.base_height_m,
        tool=ToolLink(tool.link, tool.name, _OPENING, seat_of(config) if holds else None),
        # If the landing plane is at height zero, the trial ends before the object could touch the ground.
        ground_is_solid=config.scene.landing_height_m > 0,
        object=object_of(config),
        bodies=bodies_of(config),
    )


def seat_of(config: Config) -> Vector | None:
    """Find the centre of the object in the frame of the tool at the start [m]; None if it does not start there."""
    return tool_of(config).ball_seat(object_of(config).radius_m) if starts_in_tool(config) else None


def physics_of(config: Config, moving: tuple[str, ...]) -> Physics:
    """Collect the numbers that the physics of a trial with these moving joints depends on."""
    robot = robot_of(config)
    efforts = joint_limits(robot).effort * config.robot.effort_scale
    return Physics(
        hz=config.sim.physics_hz,
        solver_iterations=config.sim.solver_iterations,
        gravity_mps2=config.scene.gravity_mps2,
        surface_friction=config.scene.spoon_friction,
        efforts=tuple(float(efforts[robot.joints.index(joint)]) for joint in moving),
        position_gain_per_s=config.robot.position_gain_per_s,
        velocity_gain=config.robot.velocity_gain,
    )


def drag_of(config: Config) -> float:
    """Compute the air's force on the object, divided by the square of its speed [kg/m]; only balls have any."""
    if config.acted_on != BALL:
        return 0.0
    return config.ball.drag_coefficient * config.scene.air_density_kgpm3 * math.pi * config.ball.radius_m**2 / 2
