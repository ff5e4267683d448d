import os
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from throwcollect.collect.runtimes import local
from throwcollect.collect.runtimes.local import LocalNodes
from throwcollect.collect.runtimes.nodes import NodeExit, NodeRole, NodeSpec
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.config.schema import Config
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router_endpoint import split_address
from throwcollect.run_key import RunKey


def context(directory: Path) -> RunRecord:
    return RunRecord("run", directory, directory / "logs", 1, Middleware(), RunKey(directory / "key"))


def nodes(directory: Path, **run: object) -> LocalNodes:
    return LocalNodes(context(directory), Config.model_validate({"run": run}))


def node(code: str, name: str = "node") -> NodeSpec:
    return NodeSpec(name, (code,), NodeRole.EXPENDABLE)


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LocalNodes]:
    """The host of a run whose nodes are small scripts: the first argument is run instead of a command."""
    monkeypatch.setattr(local, "make_command", lambda: [sys.executable, "-c", "import sys; exec(sys.argv[1])"])
    monkeypatch.setenv("ANSWER", "42")
    host = nodes(tmp_path, domain_id=7)
    yield host
    host.stop(host.running(), grace_s=0.0)
    host.close()


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline, "did not happen"
        time.sleep(0.01)


def wait_for_end(runtime: LocalNodes) -> NodeExit:
    found: list[NodeExit] = []
    until(lambda: bool(found.extend(runtime.exits()) or found))
    return found[0]


def test_a_node_that_ends_is_reported_once_with_its_code_and_last_lines(runtime: LocalNodes) -> None:
    words = "*range(50), os.environ['ANSWER'], os.environ['ROS_DOMAIN_ID']"
    runtime.start(node(f"import os; print({words}, sep='\\n'); sys.exit(7)"))
    assert runtime.running() == ("node",)
    end = wait_for_end(runtime)
    assert (end.name, end.code, end.reason) == ("node", 7, "exit code 7")
    assert end.log.splitlines() == [*map(str, range(12, 50)), "42", "7"]
    assert (runtime.exits(), runtime.running()) == ([], ())


def test_a_node_has_a_core_a_session_and_a_log_of_its_own(runtime: LocalNodes) -> None:
    core = max(os.sched_getaffinity(0))
    runtime.start(replace(node("import time; print('here', flush=True); time.sleep(60)"), core=core))
    until(lambda: runtime.logs.tail("node") == "here")
    process = psutil.Process(int(runtime.handle("node") or 0))
    assert process.cpu_affinity() == [core]
    assert os.getsid(process.pid) == process.pid
    streams = [os.readlink(f"/proc/{process.pid}/fd/{number}") for number in range(3)]
    assert streams == ["/dev/null", *[str(runtime.logs.path("node"))] * 2]


def test_a_node_that_a_signal_ends_is_reported_with_that_signal(runtime: LocalNodes) -> None:
    runtime.start(node("import time; time.sleep(60)"))
    runtime.signal("node", signal.SIGKILL)
    assert wait_for_end(runtime).reason == "ended by SIGKILL"
    # A signal to a node that has ended is ignored.
    runtime.signal("node", signal.SIGKILL)


def test_the_readiness_and_the_log_of_a_node_outlive_it(runtime: LocalNodes) -> None:
    assert not runtime.logs.said_ready("node")
    runtime.start(node("print('node is ready', flush=True); import time; time.sleep(60)"))
    until(lambda: runtime.logs.said_ready("node"))
    runtime.signal("node", signal.SIGTERM)
    wait_for_end(runtime)
    assert runtime.logs.said_ready("node")
    assert runtime.logs.tail("node") == "node is ready"


def test_a_node_that_a_signal_stops_is_frozen_until_it_continues(runtime: LocalNodes) -> None:
    runtime.start(node("import time; time.sleep(60)"))
    assert runtime.frozen() == frozenset()
    runtime.signal("node", signal.SIGSTOP)
    until(lambda: runtime.frozen() == {"node"})
    runtime.signal("node", signal.SIGCONT)
    until(lambda: not runtime.frozen())


def test_a_node_that_ignores_requests_is_ended_by_force(runtime: LocalNodes) -> None:
    deaf = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('deaf', flush=True)"
    runtime.start(node(f"{deaf}; time.sleep(60)"))
    until(lambda: runtime.logs.tail("node") == "deaf")
    process = psutil.Process(int(runtime.handle("node") or 0))
    runtime.stop(["node"], grace_s=0.1)
    assert not process.is_running()
    assert (runtime.running(), runtime.handle("node")) == ((), None)


def test_the_port_of_the_router_is_reserved_until_the_router_starts(runtime: LocalNodes) -> None:
    host, port = split_address(runtime.endpoint)
    with socket.socket() as other, pytest.raises(OSError, match="Address already in use"):
        other.bind((host, port))
    runtime.start(node(f"import socket; socket.create_server(('{host}', {port})); print('bound')", "router"))
    wait_for_end(runtime)
    assert runtime.logs.tail("router") == "bound"
