"""Translates states of bodies from ROS messages, and to them."""

from __future__ import annotations

from throwcollect.engines.engine import BodyState
from throwcollect.ros.msg import EntityState, Pose, Twist
from throwcollect.sim.entities import WORLD_FRAME
from throwcollect.units import NS_PER_S


def body_state(pose: Pose, twist: Twist | None = None) -> BodyState:
    """Read a state from messages; without a twist, the body stands still."""
    position, orientation = pose.position, pose.orientation
    place = (position.x, position.y, position.z)
    turn = (orientation.x, orientation.y, orientation.z, orientation.w)
    if twist is None:
        return BodyState(place, turn)
    linear, angular = twist.linear, twist.angular
    return BodyState(place, turn, (linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z))


def entity_state(state: BodyState, now_ns: int) -> EntityState:
    """Make a simulation_interfaces/msg/EntityState of a body at a time; accelerations are not measured."""
    message = EntityState()
    message.header.frame_id = WORLD_FRAME
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(now_ns, NS_PER_S)
    position, orientation = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = state.position
    orientation.x, orientation.y, orientation.z, orientation.w = state.orientation_xyzw
    linear, angular = message.twist.linear, message.twist.angular
    linear.x, linear.y, linear.z = state.linear_velocity
    angular.x, angular.y, angular.z = state.angular_velocity
    return message
