"""Another user of the machine finds a run and its router, and can neither hear nor change anything.

All tests look at one collection, which goes on while they do.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import ssl
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from rclzenoh.session_config import OVERRIDE_VARIABLE, client_override
from tests.e2e.collection import FAST, Running, call, journal, start, write_config
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.dataset.directory import CARD
from throwcollect.errors import UnreachableError
from throwcollect.run_key import RunKey
from throwcollect.state_directory import STATE_VARIABLE

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.skipif(os.getuid() != 0, reason="only root can become another user"),
]
NOBODY = 65534
TRIALS = 12
UNTIL_STOPPED = ("--trials", "200", "--set", "sim.real_time_factor=1")
"""Makes the collection outlast these tests; the first trials do not depend on the number of trials."""

BECOME_NOBODY = f"""
os.setgroups([])
os.setresgid({NOBODY}, {NOBODY}, {NOBODY})
os.setresuid({NOBODY}, {NOBODY}, {NOBODY})
"""
"""This code runs after all imports, as the other user may not be able to read this interpreter."""

ATTEMPT = f"""
import json, os, sys, time, zenoh
from throwcollect.errors import ConfigError
from throwcollect.ros.connection import zenoh_errors
from rclzenoh.endpoint import Attachment
from rclzenoh.interfaces import serialize
from rclzenoh.interfaces.srv import GetParameters
from rclzenoh.session_config import environment_config
REQUEST, ATTACHMENT = serialize(GetParameters.Request()), Attachment(1, 0, bytes(16)).pack()
{BECOME_NOBODY}
heard = []
for name, override in json.loads(sys.argv[1]).items():
    os.environ["ZENOH_CONFIG_OVERRIDE"] = override
    try:
        with zenoh_errors():
            session = zenoh.open(environment_config())
    except (zenoh.ZError, ConfigError) as error:
        print(f"{{name}}: {{error}}")
        continue
    subscriber = session.declare_subscriber("**", lambda sample: heard.append(str(sample.key_expr)))
    session.put("0/sim_0/episode/std_msgs::msg::dds_::UInt8MultiArray_/RIHS01_0", b"an episode")
    asked = session.get("0/sim_0/sim_0/get_parameters/**", payload=REQUEST, attachment=ATTACHMENT, timeout=3.0)
    answers = len(list(asked))
    time.sleep(0.5)
    session.close()
    print(f"{{name}}: HAS A SESSION, heard {{len(heard)}} messages, was answered {{answers}} times")
"""
"""An intruder that subscribes, publishes and calls services wherever it gets a session."""

POSE = f"""
import json, os, sys
import concurrent.futures.process, concurrent.futures.thread, email.parser, mmap, multiprocessing.pool
import pinocchio, pyarrow.parquet, scipy.stats
import throwcollect.collect.coordinator_node.node, throwcollect.collect.coordinator.resume, throwcollect.dataset.reader
import throwcollect.cli.node_commands, throwcollect.engines.bullet.bullet_engine
import throwcollect.ros.nodes.simulation.process
from throwcollect.cli.main import main
from rclzenoh import context
context._PATIENCE_S = 0.5
{BECOME_NOBODY}
for words in json.loads(sys.argv[1]):
    if (node := os.fork()) == 0:
        sys.argv[1:] = words
        main()
    print(os.waitstatus_to_exitcode(os.waitpid(node, 0)[1]), flush=True)
"""
"""An intruder that starts nodes."""

LOOK = f"""
import os, pathlib, sys
{BECOME_NOBODY}
for path in map(pathlib.Path, sys.argv[1:]):
    try:
        print([*path.iterdir()] if path.suffix == "" else path.read_bytes())
    except PermissionError:
        print("refused")
"""
"""An intruder that reads files and lists directories."""

LIKELIEST = "with a key of its own and the router's certificate"


@dataclass(frozen=True)
class Scene:
    """A collection that goes on, and somebody else on the machine.

    Attributes:
        running: The collection.
        undisturbed: The beginning of the same collection, out of reach.
        record: What its owner's commands know of it; the router has an address.
        key: Its key.
        home: A directory of the other user.
        ways: Ways to the router that the other user can find out about, as values of `OVERRIDE_VARIABLE`.
    """

    running: Running
    undisturbed: Running
    record: RunRecord
    key: RunKey
    home: Path
    ways: dict[str, str]

    def as_nobody(self, code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Python code that another user runs."""
        own = {name: os.environ[name] for name in ("PATH", "PYTHONPATH") if name in os.environ}
        return subprocess.run(
            [sys.executable, "-c", code, *arguments],
            env={**own, "HOME": str(self.home), OVERRIDE_VARIABLE: self.ways[LIKELIEST]},
            cwd=self.home,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )


@pytest.fixture(scope="module")
def scene() -> Iterator[Scene]:
    # Other users cannot enter the directories of pytest, so the scene is elsewhere.
    with tempfile.TemporaryDirectory() as directory:
        Path(directory).chmod(0o755)
        yield from _scene_in(Path(directory))


def _scene_in(directory: Path) -> Iterator[Scene]:
    state = directory / "state"
    # Other users can read this directory, as most directories.
    state.mkdir(mode=0o755)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE_VARIABLE, str(state))
        # Without an engine, no runs of other users on this machine are seen.
        patch.setenv("DOCKER_HOST", f"unix://{directory}/none.sock")
        config = write_config(directory, trials=TRIALS, sim=FAST)
        running = start(config, directory / "data", 2, *UNTIL_STOPPED)
        elsewhere = {STATE_VARIABLE: str(directory / "elsewhere")}
        undisturbed = start(config, directory / "undisturbed", 1, **elsewhere)
        try:
            running.wait_until(lambda: running.count_bytes() > 0)
            (run,) = Records().all()
            assert run.record.endpoint is not None
            home = directory / "home"
            home.mkdir()
            yield Scene(running, undisturbed, run.record, run.key, home, _ways(run.record.endpoint, home))
        finally:
            running.process.kill()
            undisturbed.process.kill()


def _ways(endpoint: str, home: Path) -> dict[str, str]:
    """Ways to the router for somebody who knows where it is, and can make keys."""
    forged = RunKey(home / "forged")
    forged.create()
    # Every client can get the router's certificate; with it, the client trusts the router, but not the reverse.
    shown = RunKey(home / "shown")
    shutil.copytree(forged.directory, shown.directory)
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    shown.certificate.write_text(ssl.get_server_certificate((host, int(port))))
    for path in (home, *home.rglob("*")):
        os.chown(path, NOBODY, NOBODY)
    trusting = client_override(endpoint, forged).replace(
        f'root_ca_certificate="{forged.certificate}"', f'root_ca_certificate="{shown.certificate}"'
    )
    return {
        "without TLS": client_override(endpoint.replace("tls/", "tcp/"), forged),
        "with a key of its own": client_override(endpoint, forged),
        LIKELIEST: trusting,
        "with the router's certificate": client_override(endpoint, shown),
        "without a certificate": f'mode="client";connect/endpoints=["{endpoint}"];'
        f'transport/link/tls/root_ca_certificate="{shown.certificate}";transport/link/tls/verify_name_on_connect=false',
    }


def test_another_user_gets_no_session_with_the_router(scene: Scene) -> None:
    """Without a session, a user can neither hear nor send anything."""
    said = scene.as_nobody(ATTEMPT, json.dumps(scene.ways))
    assert len(said.stdout.splitlines()) == len(scene.ways) == 5, said
    for line in said.stdout.splitlines():
        assert ": Unable to connect to any of " in line, said


def test_a_client_with_the_key_can_listen_publish_and_call(scene: Scene) -> None:
    """This shows that the test above does not pass only because the run is silent."""
    with_key = client_override(scene.record.endpoint or "", scene.key)
    said = subprocess.run(
        [sys.executable, "-c", ATTEMPT.replace(BECOME_NOBODY, ""), json.dumps({"owner": with_key})],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert re.match("owner: HAS A SESSION, heard [1-9].* messages, was answered 1 times\n", said.stdout), said


def test_another_user_cannot_start_a_node_in_the_run(scene: Scene) -> None:
    """Neither a simulation nor a coordinator of another user connects to the router."""
    (scene.home / "other.yaml").write_text((scene.running.directory.parent / "small.yaml").read_text())
    nodes = ["sim", "other.yaml", "--name", "evil"], ["coordinator", "data", "--config", "other.yaml"]
    said = scene.as_nobody(POSE, json.dumps(nodes))
    assert re.findall(r"^\d+$", said.stdout, re.MULTILINE) == [str(UnreachableError.exit_code)] * 2, said
    assert len(re.findall(r"no Zenoh session within [\d.]+ s; connecting to", said.stderr)) == 2, said


def test_another_user_cannot_read_the_key_or_list_the_runs(scene: Scene) -> None:
    assert scene.key.exists
    places = (scene.key.private_key, scene.key.certificate, scene.key.directory, scene.key.directory.parents[1])
    said = scene.as_nobody(LOOK, *map(str, places))
    assert said.stdout.splitlines() == ["refused"] * len(places), said
    with_its_path = client_override(scene.record.endpoint or "", scene.key)
    said = scene.as_nobody(ATTEMPT, json.dumps({"thief": with_its_path}))
    assert re.match("thief: the key of the run cannot be read: .*/key.pem: Permission denied\n", said.stdout), said


def test_arguments_and_environment_of_nodes_do_not_show_the_key(scene: Scene) -> None:
    secret = scene.key.private_key.read_text().splitlines()[1]
    for node in (scene.running.process.pid, *(int(node.handle or 0) for node in scene.record.nodes)):
        for told in ("cmdline", "environ"):
            assert secret not in Path(f"/proc/{node}/{told}").read_text(errors="replace")


def test_a_shell_that_evaluates_ros_env_has_joined_the_run(scene: Scene) -> None:
    """In a shell of the owner, `ros topic list` stands for any node that is started after `ros env`."""
    throwcollect = f"{sys.executable} -m throwcollect"
    script = f'eval "$({throwcollect} ros env)"; {throwcollect} ros topic list; printenv RMW_IMPLEMENTATION'
    said = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=60, check=False)
    assert (said.returncode, said.stderr) == (0, "")
    assert {"/sim_0/joint_states", "/sim_1/joint_states"} <= set(said.stdout.splitlines())
    assert said.stdout.endswith("rmw_zenoh_cpp\n")


def test_the_owner_can_scale_the_run(scene: Scene) -> None:
    assert call("scale", "3").returncode == 0
    (listed,) = json.loads(call("ps", "--json").stdout)
    assert (listed["run"], listed["simulations"]) == (scene.record.run, 3)


def test_the_attacks_do_not_change_the_collected_trials(scene: Scene) -> None:
    """This test has to be the last one, as it ends the collection."""
    assert call("stop").returncode == 0
    code, out, _ = scene.running.finish()
    assert (code, "run.open" in out) == (130, False)
    collected = commits(scene.running)
    assert 0 in collected
    code, out, err = scene.undisturbed.finish()
    assert (code, "\nopen " in out) == (0, False), err
    assert "| open |" not in (scene.undisturbed.directory / CARD).read_text()
    expected = commits(scene.undisturbed)
    assert collected.items() & expected.items() == {
        (trial, digest) for trial, digest in collected.items() if trial in expected
    }
    assert "evil" not in (scene.running.directory / "logs" / "journal.jsonl").read_text()


def commits(running: Running) -> dict[int, str]:
    """Digest of every episode that was written, by trial."""
    entries = journal(running.directory)
    return {entry["trial"]: entry["digest"] for entry in entries if entry["event"] == "commit"}
