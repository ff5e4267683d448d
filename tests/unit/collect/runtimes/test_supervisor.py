import math
import signal
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from throwcollect.collect.runtimes import supervisor as module
from throwcollect.collect.runtimes.node_collection import roster
from throwcollect.collect.runtimes.node_logs import NodeLogs
from throwcollect.collect.runtimes.nodes import COORDINATOR, ROUTER, NodeExit, NodeHost, NodeSpec
from throwcollect.collect.runtimes.run_record import NodeState, RunRecord
from throwcollect.collect.runtimes.supervisor import Supervisor
from throwcollect.config.run import RunConfig
from throwcollect.config.schema import Config
from throwcollect.errors import UnreachableError, WorkerError
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey

SIMULATIONS = ("sim_0", "sim_1")


class Clock:
    """Time that passes only when somebody sleeps."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.on_sleep: Callable[[], None] = lambda: None

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        self.on_sleep()


class FakeLogs(NodeLogs):
    """Logs without files."""

    def __init__(self) -> None:
        super().__init__(Path("/logs"))
        self.ready_ones: set[str] = set()

    def skip(self, name: str) -> None:
        self.ready_ones.discard(name)

    def said_ready(self, name: str) -> bool:
        return name in self.ready_ones

    def tail(self, name: str) -> str:
        return f"log of {name}"


class FakeRuntime(NodeHost):
    """A host of nodes that do what the test says."""

    data = "/data"
    listen = "tcp/127.0.0.1:1"

    def __init__(self) -> None:
        self.config = Config()
        self.record = RunRecord("run", Path("/data"), Path("/logs"), 2, Middleware(), RunKey(Path("/key")))
        self.commands: list[tuple[str, tuple[str, ...]]] = []
        self.signals: list[tuple[str, signal.Signals]] = []
        self.stopped: list[tuple[str, float]] = []
        self.alive: list[str] = []
        self.logs: FakeLogs = FakeLogs()
        self.paused: set[str] = set()
        self.closed = False
        self._ends: list[NodeExit] = []

    @property
    def endpoint(self) -> str | None:
        return None

    def start(self, node: NodeSpec) -> None:
        assert node.name not in self.alive
        self.commands.append((node.name, node.arguments))
        self.alive.append(node.name)

    def handle(self, name: str) -> str | None:
        return f"id of {name}" if name in self.alive else None

    def running(self) -> tuple[str, ...]:
        return tuple(self.alive)

    def exits(self) -> list[NodeExit]:
        ends, self._ends = self._ends, []
        return ends

    def frozen(self) -> frozenset[str]:
        return frozenset(self.paused)

    def signal(self, name: str, number: signal.Signals) -> None:
        self.signals.append((name, number))

    def stop(self, names: Sequence[str], *, grace_s: float = 3.0) -> None:
        self.stopped += [(name, grace_s) for name in names]
        self.alive = [name for name in self.alive if name not in names]

    def close(self) -> None:
        self.closed = True

    def die(self, name: str, code: int = 3, log: str = "") -> None:
        self.alive.remove(name)
        self._ends.append(NodeExit(name, code, f"exit code {code}", log))

    @property
    def started(self) -> list[str]:
        """Names of the nodes started since the last look."""
        names = [name for name, _ in self.commands]
        self.commands.clear()
        return names


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    monkeypatch.setattr(module, "count_cores", lambda: 2)
    return clock


@pytest.fixture
def runtime() -> FakeRuntime:
    return FakeRuntime()


def supervise(runtime: FakeRuntime, *, simulations: int = 2, **run: int) -> Supervisor:
    """A supervisor whose simulations are ready."""
    supervisor = Supervisor(runtime, RunConfig(**run), roster(runtime, simulations))
    supervisor.start()
    runtime.logs.ready_ones |= set(SIMULATIONS)
    supervisor.poll()
    return supervisor


def state(supervisor: Supervisor, name: str) -> NodeState:
    return next(state for state in supervisor.states() if state.name == name)


def wait_for_start(supervisor: Supervisor, runtime: FakeRuntime, clock: Clock, name: str) -> float:
    """Time until a node is started again [s], in steps of 50 ms."""
    begin = clock.now
    while name not in runtime.alive:
        clock.now += 0.05
        supervisor.poll()
        assert clock.now < begin + 100, "is not started again"
    return clock.now - begin


def test_the_router_is_started_first_and_the_coordinator_last(runtime: FakeRuntime, clock: Clock) -> None:
    Supervisor(runtime, RunConfig(), roster(runtime, 2)).start()
    assert runtime.commands == [
        ("router", ("router", "--listen", "tcp/127.0.0.1:1")),
        ("sim_0", ("sim", "/data/config.yaml", "--name", "sim_0")),
        ("sim_1", ("sim", "/data/config.yaml", "--name", "sim_1")),
        ("coordinator", ("coordinator", "/data")),
    ]


def test_of_many_simulations_as_many_as_cores_start_at_a_time(runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = Supervisor(runtime, RunConfig(), roster(runtime, 5))
    supervisor.start()
    assert runtime.started == [ROUTER, "sim_0", "sim_1", COORDINATOR]
    supervisor.poll()
    assert runtime.started == []
    assert state(supervisor, "sim_2") == NodeState("sim_2", "starting", 0, None, None)
    runtime.logs.ready_ones.add("sim_1")
    supervisor.poll()
    assert runtime.started == ["sim_2"]
    runtime.die("sim_0")
    supervisor.poll()
    assert runtime.started == ["sim_3"]
    runtime.logs.ready_ones |= {"sim_2", "sim_3"}
    clock.now += 1
    supervisor.poll()
    assert sorted(runtime.started) == ["sim_0", "sim_4"]


@pytest.mark.parametrize("hint", ["  try: something else", "note: run with `RUST_BACKTRACE=1` environment variable"])
def test_a_lost_node_is_restarted_and_reported(hint: str, runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = supervise(runtime)
    runtime.die("sim_1", log=f"first\nlast words\n{hint}")
    end, news = supervisor.poll()
    assert end is None
    assert news == ["sim_1 was lost (exit code 3) and is started again; its log ends: last words"]
    assert state(supervisor, "sim_1") == NodeState("sim_1", "restarting", 1, None, "exit code 3")
    wait_for_start(supervisor, runtime, clock, "sim_1")
    assert state(supervisor, "sim_1") == NodeState("sim_1", "starting", 1, "id of sim_1", "exit code 3")
    assert supervisor.poll() == (None, [])
    runtime.logs.ready_ones.add("sim_1")
    assert supervisor.poll() == (None, [])
    assert state(supervisor, "sim_1") == NodeState("sim_1", "running", 1, "id of sim_1", "exit code 3")


def test_the_wait_before_a_restart_doubles_up_to_ten_seconds(runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = supervise(runtime)
    waits = []
    for _ in range(8):
        runtime.die("sim_0")
        supervisor.poll()
        waits.append(wait_for_start(supervisor, runtime, clock, "sim_0"))
    assert waits == pytest.approx([0.2, 0.4, 0.8, 1.6, 3.2, 6.4, 10.0, 10.0], abs=0.06)


def test_a_simulation_without_restarts_left_is_given_up_while_others_go_on(runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = supervise(runtime, restarts=2)
    for _ in range(2):
        runtime.die("sim_0")
        supervisor.poll()
        wait_for_start(supervisor, runtime, clock, "sim_0")
    runtime.die("sim_0")
    assert supervisor.poll() == (None, ["sim_0 was lost (exit code 3) and is given up"])
    clock.now += 100
    supervisor.poll()
    assert state(supervisor, "sim_0") == NodeState("sim_0", "lost", 2, None, "exit code 3")
    assert state(supervisor, "sim_1").status == "running"


def test_a_simulation_that_was_never_ready_is_restarted_only_once(runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = Supervisor(runtime, RunConfig(restarts=10), roster(runtime, 2))
    supervisor.start()
    runtime.logs.ready_ones.add("sim_1")
    runtime.die("sim_0")
    assert "is started again" in supervisor.poll()[1][0]
    wait_for_start(supervisor, runtime, clock, "sim_0")
    runtime.die("sim_0")
    assert "is given up" in supervisor.poll()[1][0]


def test_a_run_without_simulations_left_fails_with_the_log_of_the_last(runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = supervise(runtime, restarts=0)
    runtime.die("sim_0")
    supervisor.poll()
    runtime.die("sim_1", log="no memory")
    message = "no simulation can be kept alive; the last, sim_1, ended again after 0 restarts: exit code 3"
    with pytest.raises(WorkerError, match=message) as caught:
        supervisor.poll()
    assert caught.value.evidence == "no memory"


def test_a_run_fails_if_its_router_has_no_restarts_left(runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = supervise(runtime, restarts=1)
    runtime.die(ROUTER)
    assert supervisor.poll()[1] == ["router was lost (exit code 3) and is started again"]
    wait_for_start(supervisor, runtime, clock, ROUTER)
    runtime.die(ROUTER)
    with pytest.raises(WorkerError, match="the router ended again after 1 restart: exit code 3"):
        supervisor.poll()


def test_a_lost_discovery_server_is_restarted_only_after_eleven_seconds(runtime: FakeRuntime, clock: Clock) -> None:
    runtime.record = replace(runtime.record, middleware=Middleware("rclpy", "rmw_fastrtps_cpp"))
    supervisor = Supervisor(runtime, RunConfig(), roster(runtime, 2))
    supervisor.start()
    runtime.die(ROUTER)
    supervisor.poll()
    clock.now += 10.9
    supervisor.poll()
    assert state(supervisor, ROUTER).status == "restarting"
    clock.now += 0.2
    supervisor.poll()
    assert state(supervisor, ROUTER).status == "running"


def test_the_end_of_the_coordinator_is_returned_even_if_simulations_are_lost(
    runtime: FakeRuntime, clock: Clock
) -> None:
    supervisor = supervise(runtime, restarts=0)
    for name in SIMULATIONS:
        runtime.die(name)
    runtime.die(COORDINATOR, 0)
    end, _ = supervisor.poll()
    assert end == NodeExit(COORDINATOR, 0, "exit code 0", "")


def test_a_run_fails_if_no_simulation_is_ready_in_time(runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = Supervisor(runtime, RunConfig(start_timeout_s=7), roster(runtime, 2))
    supervisor.start()
    clock.now += 6.9
    supervisor.poll()
    assert state(supervisor, "sim_0").status == "starting"
    clock.now += 0.2
    with pytest.raises(WorkerError, match=r"no simulation was ready within 7 s \(run.start_timeout_s\)") as caught:
        supervisor.poll()
    assert caught.value.evidence == "log of sim_0"


@pytest.mark.parametrize("name", ["sim_0", ROUTER, COORDINATOR])
def test_a_frozen_node_is_ended_after_three_seconds(name: str, runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = supervise(runtime)
    runtime.paused.add(name)
    supervisor.poll()
    clock.now += 2.9
    assert supervisor.poll() == (None, [])
    assert (state(supervisor, name).status, runtime.signals) == ("frozen", [])
    clock.now += 0.2
    assert supervisor.poll() == (None, [f"{name} is frozen (paused or stopped) and is ended"])
    assert supervisor.poll() == (None, [])
    assert runtime.signals == [(name, signal.SIGKILL)]


@pytest.mark.parametrize("code", [-9, 137, UnreachableError.exit_code])
def test_a_coordinator_that_was_killed_or_found_no_router_is_restarted(
    code: int, runtime: FakeRuntime, clock: Clock
) -> None:
    supervisor = supervise(runtime, restarts=1)
    runtime.die(COORDINATOR, code)
    end, news = supervisor.poll()
    assert end is None
    assert [line.endswith("and is started again") for line in news] == [True]
    assert supervisor.drain() is None
    wait_for_start(supervisor, runtime, clock, COORDINATOR)
    runtime.die(COORDINATOR, code)
    assert supervisor.poll()[0] is not None


@pytest.mark.parametrize("code", [0, 1, 2, 3, 4, 130])
def test_a_coordinator_that_exits_by_itself_is_not_restarted(code: int, runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = supervise(runtime)
    runtime.die(COORDINATOR, code)
    end, _ = supervisor.poll()
    assert (end is not None, state(supervisor, COORDINATOR).restarts) == (True, 0)


def test_a_hanging_simulation_is_ended_only_once_until_it_recovers(runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = supervise(runtime)
    for hung in (["sim_0"], ["sim_0", "sim_1"], ["sim_1"], [], ["sim_0"]):
        supervisor.replace(hung)
    assert runtime.signals == [("sim_0", signal.SIGKILL), ("sim_1", signal.SIGKILL), ("sim_0", signal.SIGKILL)]


def test_scaling_up_starts_simulations_and_scaling_down_ends_the_last(runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = supervise(runtime)
    assert runtime.started
    supervisor.change(roster(runtime, 4))
    assert runtime.started == ["sim_2", "sim_3"]
    supervisor.change(roster(runtime, 1))
    assert [name for name, _ in runtime.stopped] == ["sim_1", "sim_2", "sim_3"]
    assert [each.name for each in supervisor.states()] == [ROUTER, "sim_0", COORDINATOR]
    assert runtime.started == []


def test_draining_asks_the_coordinator_and_waits_for_its_end(runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = supervise(runtime)
    left = iter([False, False, True])

    def end_at_last() -> None:
        if next(left):
            runtime.die(COORDINATOR, 130)

    clock.on_sleep = end_at_last
    assert supervisor.drain() == NodeExit(COORDINATOR, 130, "exit code 130", "")
    assert runtime.signals == [(COORDINATOR, signal.SIGTERM)]
    assert runtime.stopped == []


def test_a_coordinator_that_does_not_drain_is_ended_by_force(runtime: FakeRuntime, clock: Clock) -> None:
    supervisor = supervise(runtime)
    begin = clock.now
    assert supervisor.drain() is None
    assert math.isclose(clock.now - begin, 15.0, abs_tol=0.1)
    assert runtime.stopped == [(COORDINATOR, 0.0)]
