"""Simulations of other machines join a run and leave it as they like: network namespaces stand for the machines."""

from __future__ import annotations

import os
import re
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from rclzenoh.session_config import OVERRIDE_VARIABLE, client_override
from tests.commands import Command, command, start_command
from tests.e2e.collection import (
    CONFIG,
    FAST,
    Running,
    call,
    call_here,
    collect_here,
    fingerprints,
    launch,
)
from tests.restrictions import Restrictions
from throwcollect.run_key import RunKey

pytestmark = pytest.mark.e2e
TRIALS = 30
SLOW = "sim.real_time_factor=1"
"""Makes the run outlast the interventions of a test, without changing the samples."""
CUT_S = 15.0
"""Longer than Zenoh waits for the other side, so that nodes have to discover each other again."""
DELAY_S = 0.05


class Machine:
    """A machine with an address of its own, on one wire with this one."""

    def __init__(self) -> None:
        self.name = f"tc{secrets.token_hex(4)}"
        # The network is drawn at random, so that tests at the same time have wires of their own.
        network = f"10.{secrets.randbelow(64) + 190}.{secrets.randbelow(256)}"
        self.gateway, self.address = f"{network}.1", f"{network}.2"
        self.wire = f"{self.name}w"

    def __enter__(self) -> Machine:
        ip("netns", "add", self.name)
        ip("link", "add", self.wire, "type", "veth", "peer", "name", "eth0", "netns", self.name)
        ip("address", "add", f"{self.gateway}/24", "dev", self.wire)
        ip("link", "set", self.wire, "up")
        for words in (f"address add {self.address}/24 dev eth0", "link set eth0 up", "link set lo up"):
            ip("-n", self.name, *words.split())
        return self

    def __exit__(self, *_: object) -> None:
        # The namespace would remove the wire only after the end of its last process.
        ip("link", "del", self.wire)
        ip("netns", "del", self.name)

    def run(self, *words: str | Path) -> list[str]:
        """A command as it is run on this machine."""
        return ["ip", "netns", "exec", self.name, *map(str, words)]

    def cut(self) -> None:
        """Pull out the wire."""
        ip("link", "set", self.wire, "down")

    def mend(self) -> None:
        """Put it in again."""
        ip("link", "set", self.wire, "up")


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


def can_make_machines() -> bool:
    if os.getuid() or shutil.which("ip") is None:
        return False
    try:
        with Machine():
            return True
    except subprocess.CalledProcessError:
        return False


needs_machines = pytest.mark.skipif(not can_make_machines(), reason="network namespaces need root and iproute2")


class SlowWire:
    """Listens on one address and passes everything on to another one, a while later: this kernel has no netem."""

    def __init__(self, address: str, port: int) -> None:
        self._target = (address, port)
        self._server = socket.create_server((address, 0))
        self.port = self._server.getsockname()[1]
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                one, _ = self._server.accept()
                other = socket.create_connection(self._target)
                for ends in ((one, other), (other, one)):
                    threading.Thread(target=self._pass_on, args=ends, daemon=True).start()

    @staticmethod
    def _pass_on(one: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while data := one.recv(1 << 16):
                time.sleep(DELAY_S)
                other.sendall(data)
        with suppress(OSError):
            other.shutdown(socket.SHUT_WR)


def listen(directory: Path, *options: str) -> tuple[Running, str, int]:
    """A run that others can join, which has no simulations of its own; its token and its port."""
    path = directory / "small.yaml"
    path.write_text(CONFIG.format(trials=TRIALS) + f"sim: {{{FAST}}}\n")
    with socket.create_server(("", 0)) as free:
        port = free.getsockname()[1]
    running = launch(
        directory / "data", "up", path, "--output", directory / "data", "-n", "0", "--runtime", "local",
        "--listen", f"tcp/0.0.0.0:{port}", *options,
    )  # fmt: skip
    assert running.process.stderr is not None
    # A run that prints no token would otherwise never end.
    late = threading.Timer(60, running.process.kill)
    late.start()
    try:
        for line in running.process.stderr:
            if found := re.search(r"join-run (tc\d+\.\S+)", line):
                return running, found[1], port
    finally:
        late.cancel()
    raise AssertionError("no token was printed")


def move_endpoint(token: str, address: str, port: int) -> str:
    """The token with another way to the router."""
    from dataclasses import replace

    from throwcollect.collect.runs.joining import JoinToken

    return replace(JoinToken.decode(token), endpoint=f"tls/{address}:{port}").encode()


def join(machine: Machine, token: str) -> Command:
    network = Restrictions(network=machine.name)
    return start_command("join-run", token, "-n", "1", stdout=subprocess.DEVNULL, restrictions=network)


def wait_for(written: int, running: Running, joined: list[Command]) -> None:
    """Wait until a run has written so many bytes; say what the joined simulations said if it does not come to that."""
    try:
        running.wait_until(lambda: running.count_bytes() >= written or any(each.poll() for each in joined), seconds=120)
        assert running.count_bytes() >= written, "a simulation that joined has failed"
    except AssertionError as error:
        for each in joined:
            each.kill()
            error.add_note(f"join-run: exit code {each.wait()}: {each.communicate()[1]}")
        raise


@pytest.fixture
def machines() -> Iterator[list[Machine]]:
    with ExitStack() as stack:
        yield [stack.enter_context(Machine()) for _ in range(3)]


@pytest.fixture
def processes() -> Iterator[list[Command]]:
    started: list[Command] = []
    yield started
    for process in started:
        process.kill()
        process.wait()


@needs_machines
def test_machines_can_join_and_leave_without_changing_the_files(
    tmp_path: Path, machines: list[Machine], processes: list[Command]
) -> None:
    running, token, port = listen(tmp_path, "--set", SLOW)
    steady, late, gone = machines
    processes += [
        join(steady, move_endpoint(token, steady.gateway, port)),
        join(gone, move_endpoint(token, gone.gateway, port)),
    ]
    wait_for(100_000, running, processes)
    gone.cut()  # so that its simulation cannot announce its end
    processes[1].kill()
    wire = SlowWire(late.gateway, port)
    processes.append(join(late, move_endpoint(token, late.gateway, wire.port)))
    wait_for(running.count_bytes() + 100_000, running, [processes[0], processes[2]])
    steady.cut()
    time.sleep(CUT_S)
    steady.mend()
    code, _, said = running.finish()
    assert code == 0, said
    for process in (processes[0], processes[2]):
        assert process.wait(30) == 0
        assert process.stderr is not None
        assert "the run is over" in process.stderr.read()
    collect_here(tmp_path / "small.yaml", tmp_path / "whole")
    whole, joined = fingerprints(tmp_path / "whole"), fingerprints(tmp_path / "data")
    same = [name for name in whole if name.endswith(".mcap") or name == "throws.parquet"]
    assert len(same) == 2
    # The other files hold the configured speed, which differs.
    assert {name: joined[name] for name in same} == {name: whole[name] for name in same}


STRANGER = """
import os, sys, zenoh
from rclzenoh.session_config import environment_config
try:
    session = zenoh.open(environment_config())
except zenoh.ZError as error:
    sys.exit(f"refused: {error}")
session.put("0/sim_0/episode", b"an episode")
print("HAS A SESSION")
"""


@needs_machines
def test_a_machine_without_the_token_cannot_join(tmp_path: Path, machines: list[Machine]) -> None:
    running, _, port = listen(tmp_path)
    machine = machines[0]
    own = RunKey(tmp_path / "own")
    own.create()
    ways = {
        "without a key": client_override(f"tls/{machine.gateway}:{port}", None),
        "with a key of its own": client_override(f"tls/{machine.gateway}:{port}", own),
        "without TLS": client_override(f"tcp/{machine.gateway}:{port}", None),
    }
    for name, way in ways.items():
        done = subprocess.run(
            machine.run(sys.executable, "-c", STRANGER),
            env={**os.environ, OVERRIDE_VARIABLE: way},
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )
        assert done.returncode == 1, name
        assert "refused" in done.stderr, name
    running.process.send_signal(signal.SIGINT)
    running.finish()


def test_a_token_is_read_from_standard_input() -> None:
    done = subprocess.run(command("join-run", "-"), input="tc3.e30\n", capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "this is no token of a run" in done.stderr


def test_only_the_owner_can_read_the_file_of_the_token(tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(CONFIG.format(trials=1) + f"sim: {{{FAST}}}\n")
    with socket.create_server(("", 0)) as free:
        port = free.getsockname()[1]
    arguments = ("up", path, "--output", tmp_path / "data", "-n", "1", "--listen", f"tcp/127.0.0.1:{port}")
    done = call(*arguments, "--token-file", tmp_path / "token")
    assert done.returncode == 0, done.stderr
    assert "tc3." not in done.stdout + done.stderr
    assert (tmp_path / "token").stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "token").read_text().startswith("tc3.")
    done = call_here("up", path, "--output", tmp_path / "other", "--token-file", tmp_path / "token")
    assert done.returncode == 2
    assert "other machines cannot join the run" in done.stderr
