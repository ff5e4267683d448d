import os
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey
from throwcollect.runtimes.local import LocalNodes, LocalRuntime
from throwcollect.runtimes.nodes import NodeExit, NodeRole, NodeSpec
from throwcollect.runtimes.ports import split_address
from throwcollect.runtimes.runtime import Place


def place(directory: Path) -> Place:
    return Place("run", directory, None, directory / "logs", 1, Middleware(), RunKey(directory / "key"))


def nodes(directory: Path, **run: object) -> LocalNodes:
    return LocalNodes(place(directory), Config.model_validate({"run": run}))


def node(code: str, name: str = "node") -> NodeSpec:
    return NodeSpec(name, (code,), NodeRole.EXPENDABLE)


@pytest.fixture(scope="module", autouse=True)
def _scripts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Nodes are small scripts: the first argument is run instead of a command."""
    directory = tmp_path_factory.mktemp("scripts")
    (directory / "sitecustomize.py").write_text(
        "import runpy, sys\nrunpy.run_module = lambda *_, **__: exec(sys.argv[1], {'sys': sys})\n"
    )
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("PYTHONPATH", os.pathsep.join([str(directory), *sys.path]))
        patched.setenv("ANSWER", "42")
        yield


@pytest.fixture(scope="module")
def begun(_scripts: None) -> Iterator[LocalRuntime]:
    """A runtime that has begun: its process, from which nodes are forked, takes a second to start."""
    runtime = LocalRuntime()
    runtime.begin(Config(), Middleware())
    yield runtime
    runtime.close()


@pytest.fixture
def runtime(begun: LocalRuntime, tmp_path: Path) -> Iterator[LocalNodes]:
    """The host of a run of that runtime."""
    local = begun.host(place(tmp_path), Config.model_validate({"run": {"domain_id": 7}}), warn=pytest.fail)
    yield local
    local.stop(local.running(), grace_s=0.0)
    local.close()


@pytest.fixture
def alone(tmp_path: Path) -> Iterator[LocalNodes]:
    """A host that starts its own process from which nodes are forked."""
    local = nodes(tmp_path / "alone", domain_id=7)
    yield local
    local.stop(local.running(), grace_s=0.0)
    local.close()


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline, "did not happen"
        time.sleep(0.01)


def wait_for_end(runtime: LocalNodes) -> NodeExit:
    found: list[NodeExit] = []
    until(lambda: bool(found.extend(runtime.exits()) or found))
    return found[0]


def test_a_node_that_ends_is_reported_once_with_its_code_and_last_lines(runtime: LocalNodes, alone: LocalNodes) -> None:
    words = "*range(50), os.environ['ANSWER'], os.environ['ROS_DOMAIN_ID']"
    for host in (runtime, alone):
        host.start(node(f"import os; print({words}, sep='\\n'); sys.exit(7)"))
        assert host.running() == ("node",)
        end = wait_for_end(host)
        assert (end.name, end.code, end.reason) == ("node", 7, "exit code 7")
        assert end.log.splitlines() == [*map(str, range(12, 50)), "42", "7"]
        assert (host.exits(), host.running()) == ([], ())


def test_a_node_that_a_signal_ends_is_reported_with_that_signal(runtime: LocalNodes) -> None:
    runtime.start(node("import time; time.sleep(60)"))
    runtime.signal("node", signal.SIGKILL)
    assert wait_for_end(runtime).reason == "ended by SIGKILL"
    # A signal to a node that has ended is ignored.
    runtime.signal("node", signal.SIGKILL)


def test_the_readiness_and_the_log_of_a_node_outlive_it(runtime: LocalNodes) -> None:
    assert not runtime.ready("node")
    runtime.start(node("print('node is ready', flush=True); import time; time.sleep(60)"))
    until(lambda: runtime.ready("node"))
    runtime.signal("node", signal.SIGTERM)
    wait_for_end(runtime)
    assert runtime.ready("node")
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


def test_a_busy_port_of_the_router_is_refused_with_a_hint(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=f"run.router_port: port {port} of 127.0.0.1 cannot be used") as caught:
            nodes(tmp_path, router_port=port)
    assert caught.value.hint == "--set run.router_port=0 takes a free one"


def test_the_port_of_the_router_is_reserved_until_the_router_starts(runtime: LocalNodes) -> None:
    host, port = split_address(runtime.endpoint)
    with socket.socket() as other, pytest.raises(OSError, match="Address already in use"):
        other.bind((host, port))
    runtime.start(node(f"import socket; socket.create_server(('{host}', {port})); print('bound')", "router"))
    wait_for_end(runtime)
    assert runtime.logs.tail("router") == "bound"
