"""`throwcollect ros action send`: sends a goal, and waits for its result."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from throwcollect import ros
from throwcollect.cli.ros.graph_session import GraphSession, RunOption, join_graph, require_name
from throwcollect.errors import ConfigError, Interrupted, ThrowcollectError
from throwcollect.ros.graph_names import absolute_name, find_interface
from throwcollect.wording import command

action_app = typer.Typer(help="Actions: send.", no_args_is_help=True)

_STATUSES = ("UNKNOWN", "ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")
"""Names of the numbers of action_msgs/msg/GoalStatus."""


@action_app.command("send_goal", hidden=True)
@action_app.command("send")
def send_goal(
    action: Annotated[str, typer.Argument(metavar="ACTION", help="Name of the action.")],
    kind: Annotated[
        str, typer.Argument(metavar="TYPE", help="Type, such as control_msgs/action/FollowJointTrajectory.")
    ],
    goal: Annotated[str, typer.Argument(metavar="GOAL", help="Fields of the goal in YAML.")],
    feedback: Annotated[bool, typer.Option("-f", "--feedback", help="Print feedback, too.")] = False,
    run: RunOption = None,
) -> None:
    """Send a goal and print its result; Ctrl-C cancels the goal."""
    from throwcollect.cli.ros.yaml_values import parse
    from throwcollect.ros.message_values import fill

    action_type = find_interface("action", kind)
    message = action_type.Goal()
    fill(message, parse(goal, "GOAL"))
    with join_graph(run) as session:
        name = absolute_name(action)
        actions = dict(ros.get_action_names_and_types(session.node))
        require_name("action", name, actions)
        client = ros.ActionClient(session.node, action_type, name)
        if not client.server_is_ready():
            raise ConfigError(f"nobody offers {name} as {kind}", expected=", ".join(actions[name]))
        print(f"Sending goal:\n{_indent(message)}", flush=True)
        sent = client.send_goal_async(message, feedback_callback=_show_feedback if feedback else None)
        try:
            handle = session.answer(sent, alive=client.server_is_ready, who=name)
            if not handle.accepted:
                echo = command("ros", "topic", "echo", "-f", "/rosout", *(("--run", run) if run is not None else ()))
                raise ConfigError(f"{name}: the goal was rejected", hint=f"the log of the node says why: {echo}")
            print(f"Goal accepted with ID: {bytes(bytearray(handle.goal_id.uuid)).hex()}\n", flush=True)
            response = session.answer(handle.get_result_async(), alive=client.server_is_ready, who=name)
        except KeyboardInterrupt:
            # Otherwise `join_graph` would only leave the graph, and the goal would go on. It may not be accepted yet.
            handle = session.answer(sent, alive=client.server_is_ready, who=name)
            if handle.accepted:
                _cancel(session, client, handle, name)
            raise Interrupted("") from None
        status = _STATUSES[response.status]
        print(f"Result:\n{_indent(response.result)}")
        print(f"Goal finished with status: {status}", flush=True)
    if status != "SUCCEEDED":
        raise ThrowcollectError(f"{name}: the goal was not reached: {status}")


def _cancel(session: GraphSession, client: ros.ActionClient, handle: Any, name: str) -> None:
    print("Canceling goal...", flush=True)
    response = session.answer(handle.cancel_goal_async(), alive=client.server_is_ready, who=name)
    print("Goal canceled." if response.goals_canceling else "The goal cannot be canceled.", flush=True)


def _show_feedback(message: Any) -> None:
    print(f"Feedback:\n{_indent(message.feedback)}", flush=True)


def _indent(message: Any) -> str:
    from throwcollect.cli.ros.yaml_values import yaml_text
    from throwcollect.ros.message_values import plain

    return "".join(f"    {line}\n" for line in yaml_text(plain(message)).splitlines())
