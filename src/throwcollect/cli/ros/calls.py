"""`throwcollect ros service` and the list of actions."""

from __future__ import annotations

from throwcollect.cli.ros.session import absolute, interface, joined, known, print_names
from throwcollect.cli.ros.values import fill, parse
from throwcollect.errors import ConfigError
from throwcollect.ros import get_action_names_and_types, get_service


def show_services(run: str | None, *, types: bool, hidden: bool) -> None:
    """Print the names of all services but our own."""
    with joined(run) as session:
        own = f"/{session.node.get_name()}/"
        services = [each for each in sorted(session.node.get_service_names_and_types()) if not each[0].startswith(own)]
        print_names(services, types=types, hidden=hidden)


def show_actions(run: str | None, *, types: bool) -> None:
    """Print the names of all actions."""
    with joined(run) as session:
        print_names(sorted(get_action_names_and_types(session.node)), types=types, hidden=False)


def call(run: str | None, service: str, kind: str, values: str) -> None:
    """Call a service and print request and response.

    Raises:
        ConfigError: If there is no such service, type or field.
        WorkerError: If the service ends before it answers.
        Interrupted: If the user leaves.
    """
    service_type = interface("srv", get_service, kind)
    request = service_type.Request()
    fill(request, parse(values, "VALUES"))
    with joined(run) as session:
        name = absolute(service)
        services = dict(session.node.get_service_names_and_types())
        known("service", name, services)
        client = session.node.create_client(service_type, name)
        if not client.service_is_ready():
            raise ConfigError(f"{name} is no {kind}", expected=", ".join(services[name]))
        print(f"requester: making request: {request!r}\n", flush=True)
        response = session.answer(client.call_async(request), alive=client.service_is_ready, who=name)
        print(f"response:\n{response!r}\n")
