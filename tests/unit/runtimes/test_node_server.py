import os
import signal
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from throwcollect.config.schema import Config
from throwcollect.runtimes.node_server import ForkedNode, NodeServer

WAIT_S = 30.0


ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "80"}


@pytest.fixture(scope="module")
def lasting() -> Iterator[NodeServer]:
    """A server for tests that do not end it, because starting one takes a second."""
    server = NodeServer(ENVIRONMENT)
    yield server
    server.close()


@pytest.fixture
def server() -> Iterator[NodeServer]:
    """A server for tests that end it."""
    server = NodeServer(ENVIRONMENT)
    yield server
    server.close()


Start = Callable[..., ForkedNode]


def starting(server: NodeServer, log: Path) -> Start:
    def start(*arguments: str, core: int | None = None) -> ForkedNode:
        with log.open("ab") as file:
            return server.start(arguments, log=file, core=core, environment={})

    return start


@pytest.fixture
def start_there(lasting: NodeServer, tmp_path: Path) -> Start:
    return starting(lasting, tmp_path / "log")


@pytest.fixture
def start(server: NodeServer, tmp_path: Path) -> Start:
    return starting(server, tmp_path / "log")


def router() -> tuple[str, ...]:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return ("router", "--listen", f"tcp/127.0.0.1:{probe.getsockname()[1]}")


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.parametrize(("argument", "code", "words"), [("--version", 0, "throwcollect "), ("dance", 2, "dance")])
def test_a_forked_node_runs_the_command_and_returns_its_exit_code(start_there, tmp_path, argument, code, words) -> None:
    assert start_there(argument).wait(WAIT_S) == code
    assert words in (tmp_path / "log").read_text()


def test_a_forked_node_has_its_own_command_line_core_session_and_log(start_there, tmp_path) -> None:
    core = max(os.sched_getaffinity(0))
    node = start_there(*(arguments := router()), core=core)
    wait_until(lambda: "listening" in (tmp_path / "log").read_text())
    process = psutil.Process(node.pid)
    assert process.cmdline()[-len(arguments) :] == list(arguments)
    assert process.cpu_affinity() == [core]
    assert os.getsid(node.pid) == node.pid
    assert signal.SIGCHLD not in {each for each in signal.Signals if _handles(node.pid, each)}
    descriptors = {os.readlink(each) for each in Path(f"/proc/{node.pid}/fd").iterdir() if int(each.name) <= 2}
    assert descriptors == {"/dev/null", str(tmp_path / "log")}
    node.send_signal(signal.SIGTERM)
    assert node.wait(WAIT_S) == 0


def test_a_signal_during_the_fork_ends_the_node(tmp_path: Path) -> None:
    # While Python prepares a forked process, it drops signals that have come and ignores exceptions of handlers.
    early = "import os, signal\nos.register_at_fork(after_in_child=lambda: os.kill(os.getpid(), signal.SIGINT))\n"
    (tmp_path / "sitecustomize.py").write_text(early)
    server = NodeServer({**ENVIRONMENT, "PYTHONPATH": str(tmp_path)})
    start = starting(server, tmp_path / "log")
    try:
        assert [start("--version").wait(WAIT_S) for _ in range(2)] == [130, 130]
    finally:
        server.close()
    assert (tmp_path / "log").read_text() == ""


def test_killing_a_node_leaves_other_nodes_alive(start_there) -> None:
    killed, other = start_there(*router()), start_there(*router())
    killed.send_signal(signal.SIGKILL)
    assert killed.wait(WAIT_S) == -signal.SIGKILL
    assert other.poll() is None
    # No signal may be sent to the id of an ended process, as another process may have that id by now.
    killed.send_signal(signal.SIGTERM)
    assert killed.wait(0.0) == -signal.SIGKILL


def test_nodes_die_with_their_server_and_the_next_node_gets_a_new_server(start) -> None:
    nodes = [start(*router()) for _ in range(2)]
    psutil.Process(nodes[0].pid).parent().kill()
    assert [node.wait(WAIT_S) for node in nodes] == [-signal.SIGKILL] * 2
    wait_until(lambda: not any(map(psutil.pid_exists, (node.pid for node in nodes))))
    assert start("--version").wait(WAIT_S) == 0


def test_a_stopped_node_server_continues_when_a_node_is_started(start_there) -> None:
    node = start_there(*router())
    psutil.Process(node.pid).parent().suspend()
    assert start_there("--version").wait(WAIT_S) == 0
    assert node.poll() is None


def _handles(pid: int, number: signal.Signals) -> bool:
    """Whether a process has a handler of its own for a signal."""
    status = Path(f"/proc/{pid}/status").read_text()
    (mask,) = (line.split()[1] for line in status.splitlines() if line.startswith("SigCgt:"))
    return bool(int(mask, 16) >> (number - 1) & 1)


def begin(server: NodeServer) -> psutil.Process:
    """Begin a server and return its process; other tests may have processes too."""
    before = set(psutil.Process().children())
    server.begin(Config())
    (begun,) = set(psutil.Process().children()) - before
    return begun


def test_a_server_begun_early_forks_the_first_node_and_closing_ends_both(server, start) -> None:
    begun = begin(server)
    node = start(*router())
    assert psutil.Process(node.pid).ppid() == begun.pid
    server.close()
    wait_until(lambda: not psutil.pid_exists(node.pid))
    assert not begun.is_running()


def test_a_node_gets_a_new_server_if_the_one_begun_early_was_killed(server, start, tmp_path) -> None:
    begin(server).kill()
    assert start("--version").wait(WAIT_S) == 0
    assert "throwcollect" in (tmp_path / "log").read_text()
