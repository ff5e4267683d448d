"""Topics and parameters that no client may have."""

from __future__ import annotations

from typing import Any

from throwcollect.collect.coordinator_node.simulation_client import EPISODE_TOPIC
from throwcollect.errors import ConfigError
from throwcollect.plan.lease import LEASES
from throwcollect.ros.graph_names import absolute_name

_GUARDED = {
    EPISODE_TOPIC: "only the coordinator may have this topic, as a slow subscriber would hold the simulation up",
    "parameter_events": "clients may not have this topic, as it has the signed leases of trials",
}
"""Last part of the name of each topic that clients may not have, and why."""
_PARAMETER_SERVICES = tuple(
    f"rcl_interfaces/srv/{name}" for name in ("GetParameters", "SetParameters", "SetParametersAtomically")
)


def is_guarded(topic: str) -> bool:
    """Whether clients may not have a topic, given by its absolute name."""
    return topic.rpartition("/")[2] in _GUARDED


def open_topic(given: str) -> str:
    """Absolute name of a topic, given by a client's name for it."""
    topic = absolute_name(given)
    if is_guarded(topic):
        raise ConfigError(f"{topic}: {_GUARDED[topic.rpartition('/')[2]]}")
    return topic


def refuse_secrets(type_name: str, request: Any) -> None:
    """Refuse a request to a service of this type that would read or set the parameter by which trials are leased."""
    if type_name in _PARAMETER_SERVICES:
        names = [*getattr(request, "names", ()), *(each.name for each in getattr(request, "parameters", ()))]
        if LEASES in names:
            raise ConfigError(f"{LEASES}: only the coordinator may have this parameter, as its leases are signed")
