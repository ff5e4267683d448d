import json
from pathlib import Path

import pytest

from throwcollect.collect.runs.events import EVENTS, Event, append_events, compare_states, parse
from throwcollect.collect.runtimes.supervisor import NodeState

STARTING = NodeState("sim_0", "starting", 0, "17", None)
RUNNING = NodeState("sim_0", "running", 0, "17", None)
FROZEN = NodeState("sim_0", "frozen", 0, "17", None)
WAITING = NodeState("sim_0", "restarting", 1, None, "ended by SIGKILL")
AGAIN = NodeState("sim_0", "running", 1, "18", "ended by SIGKILL")
LOST = NodeState("sim_0", "lost", 1, None, "exit code 1")
ROUTER = NodeState("router", "running", 0, "16", None)


def read(logs: Path) -> list[Event]:
    events = [parse(line) for line in (logs / EVENTS).read_text().splitlines()]
    return [event for event in events if event is not None]


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        ([], [ROUTER, STARTING], ["router started: 16", "sim_0 started: 17"]),
        ([STARTING], [RUNNING], ["sim_0 ready"]),
        ([RUNNING], [WAITING], ["sim_0 lost: ended by SIGKILL", "sim_0 restarting"]),
        ([WAITING], [AGAIN], ["sim_0 started: 18"]),
        ([AGAIN], [LOST], ["sim_0 lost: exit code 1", "sim_0 given up"]),
        ([RUNNING], [FROZEN], ["sim_0 frozen"]),
        ([FROZEN], [RUNNING], ["sim_0 continued"]),
        ([FROZEN], [WAITING], ["sim_0 lost: ended by SIGKILL", "sim_0 restarting"]),
        ([ROUTER, RUNNING], [ROUTER], ["sim_0 removed"]),
        ([ROUTER, LOST], [ROUTER, LOST], []),
    ],
)
def test_changes_in_the_states_of_nodes_become_events(
    before: list[NodeState], after: list[NodeState], told: list[str], tmp_path: Path
) -> None:
    append_events(tmp_path / "logs", [Event(run="small-1234", event="started", simulations=2)])
    append_events(tmp_path / "logs", compare_states("small-1234", before, after))
    assert list(map(str, read(tmp_path / "logs"))) == ["small-1234 started: 2 simulations", *told]


def test_an_event_is_one_line_of_json_without_empty_fields(tmp_path: Path) -> None:
    reason = "the coordinator stopped\n  evidence: many\n  lines"
    append_events(tmp_path, [Event(run="small-1234", event="failed", reason=reason, exit_code=3)])
    (line,) = (tmp_path / EVENTS).read_text().splitlines()
    document = json.loads(line)
    assert document.pop("time")[-6:] == "+00:00"
    assert document == {
        "run": "small-1234",
        "event": "failed",
        "reason": "the coordinator stopped\n  evidence: many\n  lines",
        "exit_code": 3,
    }
    assert str(parse(line)) == "small-1234 failed: the coordinator stopped, exit code 3"
