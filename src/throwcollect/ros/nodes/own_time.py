"""Lets the nodes of a simulation show the time that the simulation makes, and no other."""

from __future__ import annotations

from throwcollect.ros import Node, Parameter, SetParametersResult, provide_time


def make_own_time(node: Node) -> None:
    """Make a node the source of its own time: its clock shows the last ``set_ros_time_override``.

    The node refuses `use_sim_time`, with which it would show the time of the publisher of ``/clock``, and the time of
    the system afterwards.
    """
    provide_time(node)
    node.add_on_set_parameters_callback(_refuse_other_time)


def _refuse_other_time(parameters: list[Parameter]) -> SetParametersResult:
    if any(parameter.name == "use_sim_time" and parameter.value for parameter in parameters):
        return SetParametersResult(successful=False, reason="use_sim_time: this node makes its time itself")
    return SetParametersResult(successful=True)
