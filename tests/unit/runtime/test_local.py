import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from throwcollect.errors import WorkerError
from throwcollect.runtime.local import LocalRuntime, NodeExit


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LocalRuntime]:
    """A runtime whose nodes are small scripts: the first argument is run instead of a command."""
    package = tmp_path / "fake" / "throwcollect"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "__main__.py").write_text("import sys\nexec(sys.argv[1])\n")
    monkeypatch.chdir(tmp_path / "fake")
    local = LocalRuntime(tmp_path / "logs", {"ANSWER": "42"})
    yield local
    local.stop(local.running(), grace_s=0.0)


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline, "did not happen"
        time.sleep(0.01)


def ended(runtime: LocalRuntime) -> NodeExit:
    found: list[NodeExit] = []
    until(lambda: bool(found.extend(runtime.exits()) or found))
    return found[0]


def test_a_node_that_ends_is_reported_once_with_its_code_and_last_lines(runtime: LocalRuntime) -> None:
    runtime.start("node", ["import os; print(*range(50), os.environ['ANSWER'], sep='\\n'); sys.exit(7)"])
    assert runtime.running() == ("node",)
    end = ended(runtime)
    assert (end.name, end.code, end.reason) == ("node", 7, "exit code 7")
    assert end.log.splitlines() == [*map(str, range(11, 50)), "42"]
    assert (runtime.exits(), runtime.running()) == ([], ())


def test_a_signal_is_named(runtime: LocalRuntime) -> None:
    runtime.start("node", ["import time; time.sleep(60)"])
    runtime.signal("node", signal.SIGKILL)
    assert ended(runtime).reason == "ended by SIGKILL"
    runtime.signal("node", signal.SIGKILL)  # gone, so left alone


def test_what_a_node_has_said_outlives_it(runtime: LocalRuntime) -> None:
    assert not runtime.said("node", "ready")
    runtime.start("node", ["print('node is ready')"])
    ended(runtime)
    assert runtime.said("node", "node is ready")
    assert not runtime.said("node", "ready")


def test_a_node_that_ignores_requests_is_ended_by_force(runtime: LocalRuntime) -> None:
    deaf = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('deaf', flush=True)"
    runtime.start("node", [f"{deaf}; time.sleep(60)"])
    until(lambda: runtime.said("node", "deaf"))
    process = psutil.Process(runtime.pid("node"))
    runtime.stop(["node"], grace_s=0.1)
    assert not process.is_running()
    assert runtime.running() == ()


def test_a_log_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "logs").write_text("a file")
    with pytest.raises(WorkerError, match=r"node: cannot be started: .*File exists"):
        LocalRuntime(tmp_path / "logs", {}).start("node", [""])
