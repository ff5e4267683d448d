"""Topics and parameters that clients of a bridge may not have, as they would change or reveal what a run is made of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from throwcollect.coordinator.simulation_client import EPISODE_TOPIC
from throwcollect.errors import ConfigError
from throwcollect.ros.names import absolute_name
from throwcollect.trial.lease import LEASES

_GUARDED = {
    EPISODE_TOPIC: "nobody but the coordinator may have this topic, as whoever is slow would hold the simulation up",
    "parameter_events": "nobody may have this topic, as it tells the signed leases of trials",
}
"""Last part of the name of each topic that clients may not have, and why."""
_PARAMETER_SERVICES = ("get_parameters", "set_parameters", "set_parameters_atomically")


def is_guarded(topic: str) -> bool:
    """Whether clients may not have a topic, given by its absolute name."""
    return topic.rpartition("/")[2] in _GUARDED


def open_topic(given: str) -> str:
    """Absolute name of a topic, given by a client's name for it.

    Raises:
        ConfigError: If ROS does not allow the name, or clients may not have the topic.
    """
    topic = absolute_name(given)
    if is_guarded(topic):
        raise ConfigError(f"{topic}: {_GUARDED[topic.rpartition('/')[2]]}")
    return topic


def refuse_leases(parameter: str) -> None:
    """Refuse to read or set the parameter by which the coordinator leases trials.

    Raises:
        ConfigError: If ``parameter`` is its name.
    """
    if parameter == LEASES:
        raise ConfigError(f"{LEASES}: nobody but the coordinator may have this parameter, as its leases are signed")


def refuse_secrets(service: str, arguments: object) -> None:
    """Refuse to call a service of a node that would read or set the parameter by which trials are leased.

    Args:
        service: Absolute name of the service.
        arguments: Arguments of the call.

    Raises:
        ConfigError: If the call would do so.
    """
    if service.rpartition("/")[2] not in _PARAMETER_SERVICES or not isinstance(arguments, Mapping):
        return
    for each in [*_as_list(arguments.get("names")), *_as_list(arguments.get("parameters"))]:
        name = each.get("name") if isinstance(each, Mapping) else each
        if isinstance(name, str):
            refuse_leases(name)


def _as_list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []
