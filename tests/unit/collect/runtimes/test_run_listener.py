import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.coordinator_node.preview import PROGRESS_QOS, PROGRESS_TOPIC
from throwcollect.collect.runtimes import run_listener
from throwcollect.collect.runtimes.run_listener import RunListener
from throwcollect.ros import Context, Node, init, shutdown
from throwcollect.ros.connection import Connection
from throwcollect.ros.msg import String
from throwcollect.ros.router import router
from throwcollect.run_key import RunKey

PATIENCE_S = 60.0


def progress(total: int) -> Progress:
    return Progress(total, ended=0, outcomes={}, simulations=1, throws_per_s=0.0, hung=[])


@pytest.fixture
def key(tmp_path: Path) -> RunKey:
    made = RunKey(tmp_path / "key")
    made.create()
    return made


@pytest.fixture
def endpoints(key: RunKey) -> Iterator[list[str]]:
    """Routers of two runs, whose coordinators have reported totals of 1 and 2 trials."""
    with router("tls/127.0.0.1:0", key) as one, router("tcp/127.0.0.1:0") as other:
        contexts = []
        for total, endpoint in ((1, one), (2, other)):
            context = Context()
            init(context=context, connection=Connection(endpoint, key))
            contexts.append(context)
            node = Node("coordinator", context=context)
            publisher = node.create_publisher(String, PROGRESS_TOPIC, PROGRESS_QOS)
            publisher.publish(String(data=progress(total).to_json()))
        yield [one, other]
        for context in contexts:
            shutdown(context=context)


def test_a_process_can_listen_to_two_runs_at_once(endpoints: list[str], key: RunKey) -> None:
    before = dict(os.environ)
    heard: list[list[int]] = [[], []]
    listeners = [RunListener(lambda told, to=to: to.append(told.total)) for to in heard]
    deadline = time.monotonic() + PATIENCE_S
    with listeners[0], listeners[1]:
        while not all(heard) and time.monotonic() < deadline:
            for listener, endpoint in zip(listeners, endpoints, strict=True):
                listener.spin(Connection(endpoint, key), 0.05)
    assert [set(each) for each in heard] == [{1}, {2}]
    assert dict(os.environ) == before


@pytest.mark.parametrize(("reports", "times"), [(False, 1), (True, 2)])
def test_a_silent_run_is_connected_anew_only_if_it_should_report(
    endpoints: list[str], key: RunKey, monkeypatch: pytest.MonkeyPatch, *, reports: bool, times: int
) -> None:
    monkeypatch.setattr(run_listener, "_SILENT_S", -1.0)
    connected: list[Node] = []
    with RunListener(lambda _: None, reports=reports, on_connect=connected.append) as listener:
        for _ in range(2):
            listener.spin(Connection(endpoints[0], key), 0.05)
    assert len(connected) == times
