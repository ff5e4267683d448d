"""Impostors and a simulation of another configuration, beside a simulation that does its work, without a key."""

import subprocess
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.commands import Command, start_command
from tests.e2e.collection import FAST, call, write_config
from tests.unit.plan.own_plan import make_plan
from throwcollect import ros
from throwcollect.config.loader import load
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.episode_message import pack
from throwcollect.ros import SetParametersResult, get_message
from throwcollect.ros.router import router
from throwcollect.run_key import Signer
from throwcollect.sim.simulator import Simulator

TRIALS = 40
UInt8MultiArray: Any = get_message("std_msgs/msg/UInt8MultiArray")
WHOLE = ros.QoSProfile(history=ros.HistoryPolicy.KEEP_ALL, reliability=ros.ReliabilityPolicy.RELIABLE)


class Impostor(ros.Node):
    """Looks like a simulation; refuses every lease, or takes each and publishes what somebody else has signed."""

    def __init__(self, name: str, context: ros.Context, *, answer: bytes | None) -> None:
        super().__init__(name, namespace=f"/{name}", context=context)
        self.leases = 0
        self._answer = answer
        self.declare_parameter("trial.leases", "")
        self.add_on_set_parameters_callback(self._lease)
        self._episodes = self.create_publisher(UInt8MultiArray, "episode", WHOLE)

    def _lease(self, _parameters: Any) -> Any:
        self.leases += 1
        if self._answer is not None:
            self._episodes.publish(self._answer)
        return SetParametersResult(successful=self._answer is not None, reason="never")


@contextmanager
def spinning(context: ros.Context, *nodes: ros.Node) -> Iterator[None]:
    executor, over = ros.SingleThreadedExecutor(context=context), threading.Event()
    for node in nodes:
        executor.add_node(node)

    def spin() -> None:
        while not over.is_set():
            executor.spin_once(timeout_sec=0.05)

    thread = threading.Thread(target=spin)
    thread.start()
    yield
    over.set()
    thread.join()


@contextmanager
def run_in_background(*arguments: str | Path, log: Path) -> Iterator[Command]:
    with log.open("wb") as file, start_command(*arguments, stdout=file.fileno(), stderr=subprocess.STDOUT) as process:
        # The process is ended even if the test fails, as the context waits for its end in any case.
        try:
            yield process
        finally:
            process.terminate()


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> Iterator[ros.Context]:
    with router("tcp/127.0.0.1:0") as endpoint:
        monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", f'mode="client";connect/endpoints=["{endpoint}"]')
        context = ros.Context()
        context.init()
        yield context
        context.try_shutdown()


def test_impostor_simulations_do_not_change_the_dataset(graph: ros.Context, tmp_path: Path) -> None:
    config = write_config(tmp_path, trials=TRIALS, sim=FAST)
    # The run replays every trial at the end, which shows that all are right.
    config.write_text(config.read_text().replace("replay: 0", f"replay: {TRIALS}, trial_timeout_s: 3"))
    other = tmp_path / "other.yaml"
    other.write_text(config.read_text() + "ball: {friction: 0.1}\n")
    refuser = Impostor("refuser", graph, answer=None)
    forger = Impostor("forger", graph, answer=forge_message(tmp_path, other))
    data = tmp_path / "data"
    with ExitStack() as stack:
        stack.enter_context(spinning(graph, refuser, forger))
        stack.enter_context(run_in_background("sim", other, "--name", "other", log=tmp_path / "other.log"))
        stack.enter_context(run_in_background("sim", config, "--name", "sim_0", log=tmp_path / "sim.log"))
        ended = call("coordinator", data, "--config", config)
    assert ended.returncode == 0, ended.stderr
    assert f"{TRIALS} trials simulated again in a fresh process: the same bit for bit" in ended.stdout
    assert Dataset.open(data).throws["outcome"].to_pylist() == ["landed"] * TRIALS
    assert refuser.leases >= 1
    assert forger.leases >= 1
    said = ended.stdout + ended.stderr
    assert "/forger: an episode is dropped: episode: is not signed with the key of this run" in said
    assert "its episode is refused: its configuration is another one" in said
    for name in ("refuser", "other"):
        assert f"/{name}: gets no more trials, because it refused trials that other simulations could do" in said


def forge_message(directory: Path, path: Path) -> bytes:
    """A sound episode of the first trial, of another configuration, and with another key."""
    config = load(path)
    delivery = Simulator(config).run(make_plan(config, directory=directory).trials[0])
    return pack(delivery, Signer(b"a key of its own"))


def test_a_collection_ends_when_every_simulation_refuses_everything(graph: ros.Context, tmp_path: Path) -> None:
    refusers = [Impostor(f"refuser_{number}", graph, answer=None) for number in range(2)]
    with spinning(graph, *refusers):
        ended = call("coordinator", tmp_path / "data", "--config", write_config(tmp_path, trials=TRIALS, sim=FAST))
    assert ended.returncode == 3
    assert "every simulation refuses its trials, and none was ever done" in ended.stderr
    assert "evidence: leases: never" in ended.stderr
