import os
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import pytest

from rclzenoh.session_config import CONFIG_FILE_VARIABLE, OVERRIDE_VARIABLE
from throwcollect.errors import ConfigError, ConflictError, WorkerError
from throwcollect.ros import Context, Node, SingleThreadedExecutor
from throwcollect.ros.router import router
from throwcollect.runs import control, records
from throwcollect.runs.control import down, scale, stop
from throwcollect.runs.following import follow, wait
from throwcollect.runs.records import Records, Run
from throwcollect.runs.run_record import RunRecord
from throwcollect.runtimes.node_collection import MOST_SIMULATIONS, offer_scaling
from throwcollect.runtimes.nodes import LAUNCHER
from throwcollect.state_directory import STATE_VARIABLE


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))


RECORD = RunRecord("a-0123", "a", "local", "/a", None, "/a/logs", 0, datetime.now(timezone.utc), 1, 2)


def living(endpoint: str | None, runtime: str = "local") -> Run:
    # The run lives until somebody closes what this makes, or the tests end.
    Records().new("a", run="a-0123").write(replace(RECORD, endpoint=endpoint, runtime=runtime))
    return Records().get("a-0123")


@pytest.fixture
def endpoint(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.delenv(CONFIG_FILE_VARIABLE, raising=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", "0")
    with router("tcp/127.0.0.1:0") as endpoint:
        yield endpoint


@pytest.fixture
def most() -> int:
    return MOST_SIMULATIONS


@pytest.fixture
def wanted(endpoint: str, most: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """The numbers of simulations that a launcher is asked for."""
    asked: list[int] = []
    monkeypatch.setenv(OVERRIDE_VARIABLE, f'connect/endpoints=["{endpoint}"]')
    context = Context()
    context.init()
    node = Node(LAUNCHER, context=context)
    offer_scaling(node, 1, asked.append, most=most)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    done = threading.Event()

    def serve() -> None:
        while not done.is_set():
            executor.spin_once(timeout_sec=0.05)

    thread = threading.Thread(target=serve)
    thread.start()
    yield asked
    done.set()
    thread.join()
    context.shutdown()


def test_scaling_asks_the_launcher_for_the_number_of_simulations(endpoint: str, wanted: list[int]) -> None:
    run = living(endpoint)
    for simulations in (5, 0, 256):
        scale(run, simulations)
    assert wanted == [5, 0, 256]


@pytest.mark.parametrize(
    ("simulations", "reason"),
    [
        (257, "run a-0123: .* out of range. Min: 0, max: 256, value: 257"),
        (-1, "simulations: got -1\n  expected: 0 or more"),
        ("two", "simulations: got 'two'\n  expected: a whole number, 0 or more"),
    ],
)
def test_scaling_to_a_number_that_cannot_be_is_refused(
    simulations: int, reason: str, endpoint: str, wanted: list[int]
) -> None:
    with pytest.raises(ConfigError, match=reason):
        scale(living(endpoint), simulations)
    assert wanted == []


def test_scaling_a_run_that_has_no_router_yet_says_that_it_is_starting() -> None:
    with pytest.raises(ConflictError, match=r"^run a-0123: is still starting"):
        scale(living(None), 3)


@pytest.mark.parametrize("most", [1])
def test_scaling_above_the_limit_of_the_launcher_is_refused(endpoint: str, wanted: list[int]) -> None:
    run = living(endpoint)
    with pytest.raises(ConfigError, match=r"out of range. Min: 0, max: 1, value: 2"):
        scale(run, 2)
    scale(run, 0)
    assert wanted == [0]


def test_scaling_without_a_launcher_is_an_error(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control, "_ANSWER_S", 0.2)
    with pytest.raises(WorkerError, match=f"run a-0123: its launcher does not answer over the router at {endpoint}"):
        scale(living(endpoint), 3)


def test_scaling_without_a_router_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control, "_ANSWER_S", 0.2)
    with pytest.raises(WorkerError, match="run a-0123: its launcher does not answer"):
        scale(living("tcp/127.0.0.1:1"), 3)


def test_scaling_a_run_that_has_ended_since_it_was_found_says_so() -> None:
    opened = Records().new("a", run="a-0123")
    opened.write(replace(RECORD, endpoint="tcp/127.0.0.1:1"))
    run = Records().get("a-0123")
    opened.update(ended=datetime.now(timezone.utc), exit_code=0)
    opened.close()
    with pytest.raises(ConflictError, match="run a-0123 has ended"):
        scale(run, 2)


@pytest.mark.parametrize("change", [stop, wait, down, lambda run: scale(run, 2), lambda run: next(follow(run))])
@pytest.mark.parametrize("given", [None, 5])
def test_a_value_that_is_no_run_is_refused(change: Callable[[Any], object], given: object) -> None:
    with pytest.raises(ConfigError, match=rf"^(run|named): got {given}\n  expected: a (Run|path), "):
        change(given)


def test_a_run_in_one_process_cannot_be_scaled() -> None:
    with pytest.raises(ConfigError, match="run a-0123: has one simulation, as all runs of the runtime inprocess have"):
        scale(living(None, runtime="inprocess"), 2)


def test_a_launcher_that_does_not_end_is_named_unless_the_record_of_its_run_is_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = Records().new("a")
    run.write(replace(living(None).record, run=run.run, launcher=os.getpid()))
    monkeypatch.setattr(records, "_LOCK_PATIENCE_S", 0.0)
    monkeypatch.setattr(control, "_end_launcher", lambda *_: None)
    for pid in (f"its pid is {os.getpid()}", None):
        with pytest.raises(WorkerError, match=f"run {run.run}: its launcher does not end") as caught:
            control.down(run.run)
        assert caught.value.evidence == pid
        (tmp_path / "state" / "runs" / f"{run.run}.json").write_text("{")
    run.close()
