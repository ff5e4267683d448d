"""A listener during a collection gets the messages that the dataset will hold, and does not change it."""

import socket
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from mcap.reader import make_reader

from rclzenoh.interfaces import get_message
from tests.e2e.collection import FAST, collect_here, fingerprints, start, write_config
from tests.integration.robot import connect
from throwcollect.dataset.reader import Dataset
from throwcollect.ros import Context, HistoryPolicy, Node, QoSProfile, SingleThreadedExecutor

pytestmark = pytest.mark.e2e
TRIALS = 16
SIMULATIONS = ("sim_0", "sim_1")
KINDS = {"/joint_states": "sensor_msgs/msg/JointState", "/ball/odometry": "nav_msgs/msg/Odometry"}
PACED = f"{FAST}, real_time_factor: 10"
"""As fast as it can, a simulation sends faster than a busy machine reads, and what a connection cannot take is lost."""
WHOLE = QoSProfile(history=HistoryPolicy.KEEP_ALL)
_STAMP = slice(4, 12)
"""Bytes of the header's stamp in a message of either type."""

Messages = dict[str, list[bytes]]


class Listener:
    """Keeps the bytes of samples by simulation and topic."""

    def __init__(self, context: Context) -> None:
        self.heard: dict[str, Messages] = {name: {topic: [] for topic in KINDS} for name in SIMULATIONS}
        self._node = Node("listener", context=context)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        for name, messages in self.heard.items():
            for topic, kind in KINDS.items():
                append = messages[topic].append
                self._node.create_subscription(get_message(kind), f"/{name}{topic}", append, WHOLE, raw=True)

    def listen(self) -> None:
        """Take what has come so far."""
        for _ in range(1000):
            self._executor.spin_once(timeout_sec=0.0)


@contextmanager
def listener(port: int) -> Iterator[Listener]:
    with connect(f"tcp/127.0.0.1:{port}") as context:
        yield Listener(context)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def is_open(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def during_trials(messages: Messages) -> Messages:
    """Leave out messages of time 0, which simulations send before their first trial."""
    return {topic: [data for data in found if any(data[_STAMP])] for topic, found in messages.items()}


def read_recorded(directory: Path) -> dict[str, dict[bytes, int]]:
    """Trial of every message in the dataset, by topic; read by MCAP's own library."""
    starts = {episode.header.start_ns: episode.header.trial for episode in Dataset.open(directory).episodes()}
    messages: dict[str, dict[bytes, int]] = {topic: {} for topic in KINDS}
    for path in directory.glob("*.mcap"):
        with path.open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages(topics=list(KINDS)):
                start_ns = max(start for start in starts if start <= message.log_time)
                messages[channel.topic][message.data] = starts[start_ns]
    return messages


@pytest.fixture(scope="module")
def listened(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Messages]]:
    """A collection that was listened to from before its first trial, and what was heard of it."""
    directory = tmp_path_factory.mktemp("listened")
    port = free_port()
    config = write_config(directory, trials=TRIALS, sim=PACED)
    # An open run lets listeners in without a key.
    running = start(config, directory / "data", 2, "--set", f"run.router_port={port}", "--set", "run.open=true")
    running.wait_until(lambda: is_open(port))
    with listener(port) as ears:
        while running.process.poll() is None:
            ears.listen()
    code, _, err = running.finish()
    assert code == 0, err
    assert "run.open: any process that reaches the router may join, read and disturb this run\n" in err
    assert "\n| open | any process that reached the router could join" in (directory / "data" / "README.md").read_text()
    return directory / "data", {name: during_trials(messages) for name, messages in ears.heard.items()}


def test_every_message_heard_is_in_the_dataset_byte_for_byte(listened: tuple[Path, dict[str, Messages]]) -> None:
    directory, heard = listened
    messages = read_recorded(directory)
    for topic in KINDS:
        everything = [data for name in SIMULATIONS for data in heard[name][topic]]
        strange = [data for data in everything if data not in messages[topic]]
        assert len(everything) > TRIALS
        assert len(everything) == len(set(everything))
        assert not strange, f"{topic}: {len(strange)} of {len(everything)} messages are not in the dataset"


def test_a_listener_gets_all_messages_of_some_trials(listened: tuple[Path, dict[str, Messages]]) -> None:
    directory, heard = listened
    messages = read_recorded(directory)
    complete = []
    for topic in KINDS:
        wanted = Counter(messages[topic].values())
        got: dict[int, set[bytes]] = defaultdict(set)
        for name in SIMULATIONS:
            for data in heard[name][topic]:
                got[messages[topic][data]].add(data)
        complete.append({trial for trial, count in wanted.items() if len(got[trial]) == count})
    assert len(complete[0] & complete[1]) >= 3


def test_a_listener_does_not_change_the_dataset(listened: tuple[Path, dict[str, Messages]], tmp_path: Path) -> None:
    directory, _ = listened
    collect_here(write_config(tmp_path, trials=TRIALS, sim=PACED), tmp_path / "data")
    assert fingerprints(tmp_path / "data") == fingerprints(directory)
