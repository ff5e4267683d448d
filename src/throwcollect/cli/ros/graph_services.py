"""`throwcollect ros service`: lists services, and calls one."""

from __future__ import annotations

from typing import Annotated

import typer

from throwcollect.cli.ros.graph_session import join_graph, print_names, require_name
from throwcollect.cli.ros.ros_options import HiddenOption, RunOption, TypesOption
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, find_interface

service_app = typer.Typer(help="Services: list, call.", no_args_is_help=True)


@service_app.command("list")
def list_services(types: TypesOption = False, hidden: HiddenOption = False, run: RunOption = None) -> None:
    """List the services."""
    with join_graph(run) as session:
        own = f"/{session.node.get_name()}/"
        services = [each for each in sorted(session.node.get_service_names_and_types()) if not each[0].startswith(own)]
        print_names(services, types=types, hidden=hidden)


@service_app.command("call")
def call_service(
    service: Annotated[str, typer.Argument(metavar="SERVICE", help="Name of the service.")],
    kind: Annotated[str, typer.Argument(metavar="TYPE", help="Type, such as std_srvs/srv/Trigger.")],
    values: Annotated[str, typer.Argument(metavar="VALUES", help="Fields of the request in YAML.")] = "{}",
    run: RunOption = None,
) -> None:
    """Call a service and print its response."""
    from throwcollect.cli.ros.yaml_values import parse
    from throwcollect.ros.message_values import fill

    service_type = find_interface("srv", kind)
    request = service_type.Request()
    fill(request, parse(values, "VALUES"))
    with join_graph(run) as session:
        name = absolute_name(service)
        services = dict(session.node.get_service_names_and_types())
        require_name("service", name, services)
        client = session.node.create_client(service_type, name)
        if not client.service_is_ready():
            raise ConfigError(f"{name} is no {kind}", expected=", ".join(services[name]))
        print(f"requester: making request: {request!r}\n", flush=True)
        response = session.answer(client.call_async(request), alive=client.service_is_ready, who=name)
        print(f"response:\n{response!r}\n")
