"""The number of simulations as a parameter of the launcher's node, which any ROS 2 node may set."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError, WorkerError
from throwcollect.ros import IntegerRange, get_service
from throwcollect.ros.endpoint import answers
from throwcollect.run_key import RunKey
from throwcollect.runtime.nodes import LAUNCHER, node_environment
from throwcollect.runtime.records import Record, Run
from throwcollect.runtime.runs import living

SetParameters: Any = get_service("rcl_interfaces/srv/SetParameters")

SIMULATIONS = "simulations"
"""Name of the parameter."""
MOST_SIMULATIONS = 256

_ANSWER_S = 10.0
"""Time in which a launcher answers; it may be busy ending simulations."""


def offer_scaling(
    node: ros.Node, simulations: int, on_wanted: Callable[[int], None], *, most: int = MOST_SIMULATIONS
) -> None:
    """Declare the parameter.

    Args:
        node: Node of the launcher.
        simulations: Its value.
        on_wanted: Called with another value when somebody sets one.
        most: Largest value that can be set.
    """

    def tell(parameters: list[ros.Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == SIMULATIONS:
                on_wanted(int(parameter.value))

    span = IntegerRange(from_value=0, to_value=most, step=1)
    described = ros.ParameterDescriptor(description="Number of simulations.", integer_range=[span])
    node.declare_parameter(SIMULATIONS, simulations, described)
    node.add_post_set_parameters_callback(tell)


def scale(run: Run, simulations: int) -> None:
    """Ask the launcher of a run for another number of simulations.

    Raises:
        ConfigError: If the run has ended, or the launcher refuses that number.
        WorkerError: If the launcher died, or does not answer.
    """
    record = living(run)
    with _graph_of(record, run.key):
        node = ros.Node(f"_throwcollect_{os.getpid()}")
        client = node.create_client(SetParameters, f"/{LAUNCHER}/set_parameters")
        if not client.wait_for_service(_ANSWER_S):
            raise _silent(record)
        wanted = ros.Parameter(SIMULATIONS, value=simulations).to_parameter_msg()
        future = client.call_async(SetParameters.Request(parameters=[wanted]))
        ros.spin_until_future_complete(node, future, timeout_sec=_ANSWER_S)
        if not future.done():
            raise _silent(record)
        result = future.result().results[0]
        node.destroy_node()
    if not result.successful:
        raise ConfigError(f"run {record.run}: {result.reason}")


@contextmanager
def _graph_of(record: Record, key: RunKey) -> Iterator[None]:
    if record.endpoint is None or not answers(record.endpoint):
        raise _silent(record)
    os.environ.update(node_environment(record.endpoint, record.domain_id, key, record.middleware))
    ros.init()
    try:
        yield
    finally:
        ros.shutdown()


def _silent(record: Record) -> WorkerError:
    return WorkerError(
        f"run {record.run}: its launcher does not answer"
        + (f" over the router at {record.endpoint}" if record.endpoint else ""),
        hint="its router may just be starting again: try once more, or look at throwcollect events",
    )
