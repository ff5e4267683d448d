"""`throwcollect ros action send`: one goal, from its acceptance to its result."""

from __future__ import annotations

from typing import Any

from throwcollect.cli.ros.session import Session, absolute, interface, joined, known
from throwcollect.cli.ros.values import fill, parse, plain, yaml_text
from throwcollect.errors import ConfigError, Interrupted, ThrowcollectError
from throwcollect.ros import ActionClient, get_action, get_action_names_and_types, get_message

_STATUS: Any = get_message("action_msgs/msg/GoalStatus")
_NAMES = {
    getattr(_STATUS, f"STATUS_{name}"): name
    for name in ("UNKNOWN", "ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")
}


def send(run: str | None, action: str, kind: str, values: str, *, feedback: bool) -> None:
    """Send a goal and print its result; cancel it if the user leaves.

    Raises:
        ConfigError: If there is no such action, type or field, or the goal is rejected.
        WorkerError: If the action ends before the goal.
        ThrowcollectError: If the goal is not reached.
        Interrupted: If the user leaves.
    """
    action_type = interface("action", get_action, kind)
    goal = action_type.Goal()
    fill(goal, parse(values, "GOAL"))
    with joined(run) as session:
        name = absolute(action)
        actions = dict(get_action_names_and_types(session.node))
        known("action", name, actions)
        client = ActionClient(session.node, action_type, name)
        if not client.server_is_ready():
            raise ConfigError(f"nobody offers {name} as {kind}", expected=", ".join(actions[name]))
        print(f"Sending goal:\n{_indented(goal)}", flush=True)
        sent = client.send_goal_async(goal, feedback_callback=_show_feedback if feedback else None)
        handle = session.answer(sent, alive=client.server_is_ready, who=name)
        if not handle.accepted:
            raise ConfigError(
                f"{name}: the goal was rejected", hint="the log of the node says why: ros topic echo /rosout"
            )
        try:
            print(f"Goal accepted with ID: {bytes(bytearray(handle.goal_id.uuid)).hex()}\n", flush=True)
            response = session.answer(handle.get_result_async(), alive=client.server_is_ready, who=name)
        except KeyboardInterrupt:
            _cancel(session, client, handle, name)
            raise Interrupted("") from None
        print(f"Result:\n{_indented(response.result)}")
        print(f"Goal finished with status: {_NAMES[response.status]}", flush=True)
    if response.status != _STATUS.STATUS_SUCCEEDED:
        raise ThrowcollectError(f"{name}: the goal was not reached: {_NAMES[response.status]}")


def _cancel(session: Session, client: ActionClient, handle: Any, name: str) -> None:
    print("Canceling goal...", flush=True)
    response = session.answer(handle.cancel_goal_async(), alive=client.server_is_ready, who=name)
    print("Goal canceled." if response.goals_canceling else "The goal cannot be canceled.", flush=True)


def _show_feedback(message: Any) -> None:
    print(f"Feedback:\n{_indented(message.feedback)}", flush=True)


def _indented(message: Any) -> str:
    return "".join(f"    {line}\n" for line in yaml_text(plain(message)).splitlines())
