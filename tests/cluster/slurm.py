"""A Slurm of several nodes that are all this machine, for tests; root alone can start it."""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

CPUS_PER_NODE = 2
MEMORY_PER_NODE_MB = 6000
KILL_WAIT_S = 5
"""Time between SIGTERM and SIGKILL."""
_START_TIMEOUT_S = 30.0
_FIRST_PORT = 16817
_PORTS_PER_CLUSTER = 10
_CGROUPS = Path("/sys/fs/cgroup")
_LOCK = Path("/run/lock/throwcollect-slurm")

_CONFIGURATION = """\
ClusterName=ci
SlurmctldHost={host}(127.0.0.1)
SlurmUser=slurm
SlurmctldPort={port}
AuthType=auth/munge
AuthInfo=socket={directory}/munge/socket,cred_expire=6
StateSaveLocation={directory}/state
SlurmdSpoolDir={directory}/spool.%n
SlurmctldPidFile={directory}/run/slurmctld.pid
SlurmdPidFile={directory}/run/%n.pid
SlurmctldLogFile={directory}/log/slurmctld.log
SlurmdLogFile={directory}/log/%n.log
ProctrackType=proctrack/{proctrack}
TaskPlugin=task/{task}
JobAcctGatherType=jobacct_gather/{gather}
JobAcctGatherFrequency=task=2
AccountingStorageType=accounting_storage/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerType=sched/backfill
SchedulerParameters=bf_interval=2,sched_interval=2,batch_sched_delay=0,sched_min_interval=100000,nohold_on_prolog_fail
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
JobRequeue=1
ReturnToService=2
SlurmctldTimeout=30
SlurmdTimeout=5
MessageTimeout=4
InactiveLimit=0
KillWait={kill_wait_s}
MinJobAge=300
MaxArraySize=10001
DefMemPerCPU=1000
SlurmdParameters=config_overrides
PropagateResourceLimits=NONE
RebootProgram=/bin/true
NodeName=DEFAULT CPUs={cpus} RealMemory={memory_mb} State=UNKNOWN
{nodes}
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP PriorityTier=10
PartitionName=low Nodes=ALL MaxTime=INFINITE State=UP PriorityTier=1 PreemptMode=REQUEUE GraceTime=0
PartitionName=grace Nodes=ALL MaxTime=INFINITE State=UP PriorityTier=1 PreemptMode=CANCEL GraceTime=4
"""

_CGROUP_CONFIGURATION = """\
CgroupPlugin=cgroup/v1
CgroupMountpoint=/sys/fs/cgroup
CgroupAutomount=no
ConstrainRAMSpace=yes
AllowedRAMSpace=100
ConstrainSwapSpace=no
ConstrainCores=no
"""


class Slurm:
    """A Slurm with its state in a directory. Several may run on one machine, as ports and names of nodes differ.

    Partitions: `main`; `low`, whose jobs are requeued if `main` needs the place; `grace`, whose jobs then get SIGTERM
    4 s before the end. There is no accounting.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory.resolve()

    @property
    def environment(self) -> dict[str, str]:
        """What commands of Slurm have to find in their environment."""
        return {"SLURM_CONF": str(self._directory / "slurm.conf")}

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes."""
        lines = (self._directory / "slurm.conf").read_text().splitlines()
        named = [line.split()[0].removeprefix("NodeName=") for line in lines if line.startswith("NodeName=")]
        return tuple(name for name in named if name != "DEFAULT")

    def up(self, nodes: int = 3) -> None:
        """Start it, and wait until all nodes can be used."""
        if not 0 < nodes < _PORTS_PER_CLUSTER:
            raise ValueError(f"{nodes} nodes: from 1 to {_PORTS_PER_CLUSTER - 1} are possible")
        with _alone():
            self._make_directories()
            self._write_configuration(nodes)
            self._start_munge()
            self._start("slurmctld", "-f", self.environment["SLURM_CONF"])
            for node in self.nodes:
                self.revive(node)
        _wait(lambda: all(self.state(node) in ("idle", "mixed", "allocated") for node in self.nodes), self._evidence)

    def down(self) -> None:
        """End all jobs, nodes and the rest. The directory stays, for its logs."""
        for node in self.nodes:
            self.kill_node(node)
        for name in ("slurmctld", "munged"):
            _end(self._process(name), signal.SIGTERM)
        for node in self.nodes:
            _remove_cgroups(node)

    def kill_node(self, node: str) -> None:
        """End all processes of a node at once, as if its power was cut.

        Slurm notices after 10 to 20 s, and then runs its jobs again elsewhere. If the node is back before, Slurm takes
        its jobs for running, for minutes.
        """
        _end(self._process(node), signal.SIGKILL)
        # The second round finds processes that were just being started in the first.
        for _ in range(2):
            found = _processes_of(node)
            for process in found:
                # All processes are stopped first, so that none can report the end of another one to Slurm.
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGSTOP)
            for process in found:
                _end(process, signal.SIGKILL)

    def kill_slurmd(self, node: str) -> None:
        """End the slurmd of a node alone. Its jobs run on, and after a while Slurm starts them elsewhere, too."""
        _end(self._process(node), signal.SIGKILL)

    def revive(self, node: str, *, without: Path | None = None) -> None:
        """Start the slurmd of a node, which ends what is left there of jobs that have been given to another.

        Args:
            node: Its name.
            without: Directory in which the node sees nothing, as if a shared file system was not mounted there.
        """
        apart = ("unshare", "--mount", "sh", "-c", 'mount -t tmpfs none "$0" && exec "$@"', str(without))
        self._start(*(apart if without else ()), "slurmd", "-f", self.environment["SLURM_CONF"], "-N", node)

    def state(self, node: str) -> str:
        """Short name of a node's state: `idle`, `allocated`, `down*`, ..."""
        return self.run("sinfo", "--noheader", f"--nodes={node}", "--partition=main", "--format=%T").strip()

    def run(self, *command: str, user: str | None = None, cwd: Path | None = None) -> str:
        """What a command of Slurm prints.

        Args:
            command: The command with its arguments.
            user: Who calls it; None is root.
            cwd: Directory that it is called in.

        Raises:
            AssertionError: If it fails.
        """
        as_user = () if user is None else ("runuser", "-u", user, "--")
        done = subprocess.run(
            [*as_user, *command],
            check=False,
            capture_output=True,
            text=True,
            env={**os.environ, **self.environment},
            cwd=cwd,
        )
        assert done.returncode == 0, f"{' '.join(command)}: {done.stderr or done.stdout}"
        return done.stdout

    def _make_directories(self) -> None:
        self._directory.mkdir(parents=True, exist_ok=True)
        # Slurm and the users of jobs are others than root.
        self._directory.chmod(0o755)
        for name, owner in {"state": "slurm", "log": "slurm", "run": "slurm", "munge": "munge"}.items():
            directory = self._directory / name
            directory.mkdir(exist_ok=True)
            shutil.chown(directory, owner, owner)
            directory.chmod(0o755)

    def _write_configuration(self, count: int) -> None:
        port = _free_ports()
        letter = chr(ord("a") + (port - _FIRST_PORT) // _PORTS_PER_CLUSTER)
        host = socket.gethostname().partition(".")[0]
        has_cgroups = all((_CGROUPS / name / "cgroup.procs").exists() for name in ("freezer", "memory", "cpuacct"))
        nodes = []
        for number in range(1, count + 1):
            name = f"{letter}{number}"
            nodes.append(f"NodeName={name} NodeHostname={host} NodeAddr=127.0.0.1 Port={port + number}")
            (self._directory / f"spool.{name}").mkdir(mode=0o755, exist_ok=True)
        text = _CONFIGURATION.format(
            host=host,
            port=port,
            directory=self._directory,
            # Without cgroups, children of a killed batch script live on, and memory is measured but not limited.
            proctrack="cgroup" if has_cgroups else "linuxproc",
            task="cgroup" if has_cgroups else "none",
            gather="cgroup" if has_cgroups else "linux",
            kill_wait_s=KILL_WAIT_S,
            cpus=CPUS_PER_NODE,
            memory_mb=MEMORY_PER_NODE_MB,
            nodes="\n".join(nodes),
        )
        (self._directory / "slurm.conf").write_text(text)
        if has_cgroups:
            (self._directory / "cgroup.conf").write_text(_CGROUP_CONFIGURATION)

    def _start_munge(self) -> None:
        directory = self._directory / "munge"
        if not (directory / "key").exists():
            self._start("runuser", "-u", "munge", "--", "mungekey", "--create", f"--keyfile={directory}/key")
        self._start(
            *("runuser", "-u", "munge", "--", "munged", f"--socket={directory}/socket", f"--key-file={directory}/key"),
            *(f"--log-file={directory}/log", f"--seed-file={directory}/seed", f"--pid-file={directory}/munged.pid"),
        )

    def _start(self, *command: str) -> None:
        """Start what goes into the background by itself."""
        log = self._directory / "log" / "start.log"
        with log.open("a") as printed:
            path = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"
            done = subprocess.run(
                command,
                check=False,
                stdin=subprocess.DEVNULL,
                stdout=printed,
                stderr=printed,
                env={"PATH": path, **self.environment},
                cwd="/",
            )
        assert done.returncode == 0, f"{' '.join(command)} fails; see {log}"

    def _process(self, name: str) -> int | None:
        """Process of munged, slurmctld, or the slurmd of a node, if it lives."""
        folder = "munge" if name == "munged" else "run"
        try:
            process = int((self._directory / folder / f"{name}.pid").read_text())
        except (FileNotFoundError, ValueError):
            return None
        program = name if name in ("munged", "slurmctld") else "slurmd"
        return process if _name_of(process) == program else None

    def _evidence(self) -> str:
        logs = [self._directory / "log" / "slurmctld.log", *(self._directory / "log").glob("?[0-9].log")]
        return "\n".join(f"{log.name}: {log.read_text()[-1500:]}" for log in logs if log.exists())


@contextmanager
def _alone() -> Iterator[None]:
    """Hold a lock, so that no other test looks for free ports at the same time."""
    with _LOCK.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _free_ports() -> int:
    """First of as many ports in a row as one cluster needs."""
    for number in range(26):
        first = _FIRST_PORT + number * _PORTS_PER_CLUSTER
        if all(map(_is_free, range(first, first + _PORTS_PER_CLUSTER))):
            return first
    raise RuntimeError(f"no {_PORTS_PER_CLUSTER} free ports in a row from {_FIRST_PORT} on")


def _is_free(port: int) -> bool:
    with socket.socket() as tried:
        tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        with suppress(OSError):
            tried.bind(("", port))
            return True
    return False


def _processes_of(node: str) -> set[int]:
    """Processes of all jobs of a node, and those of Slurm that look after them."""
    found: set[int] = set()
    for tasks in _CGROUPS.glob(f"*/slurm_{node}/**/cgroup.procs"):
        with suppress(OSError):
            found.update(map(int, tasks.read_text().split()))
    mark = f"SLURMD_NODENAME={node}".encode()
    for process in _processes():
        with suppress(OSError):
            if mark in Path(f"/proc/{process}/environ").read_bytes().split(b"\0"):
                found.add(process)
    parents = {_parent_of(process) for process in found} - {None}
    return found | {parent for parent in parents if parent is not None and _name_of(parent) == "slurmstepd"}


def _processes() -> Iterable[int]:
    return (int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit())


def _parent_of(process: int) -> int | None:
    fields = _stat(process)
    return int(fields[1]) if fields else None


def _name_of(process: int) -> str | None:
    """Name of a living process; None for one that has ended, even if nobody has collected its exit code yet."""
    fields = _stat(process)
    if not fields or fields[0] == "Z":
        return None
    with suppress(OSError):
        return Path(f"/proc/{process}/comm").read_text().strip()
    return None


def _stat(process: int) -> list[str]:
    """State, parent and what follows in `/proc/PID/stat`; empty if there is no such process."""
    with suppress(OSError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return []


def _end(process: int | None, by: signal.Signals) -> None:
    """Send a signal, and wait until the process has ended."""
    if process is None:
        return
    with suppress(ProcessLookupError):
        os.kill(process, by)
    _wait(lambda: _name_of(process) is None, lambda: f"process {process} does not end")


def _remove_cgroups(node: str) -> None:
    for group in _CGROUPS.glob(f"*/slurm_{node}"):
        for directory, _, _ in os.walk(group, topdown=False):
            with suppress(OSError):
                Path(directory).rmdir()


def _wait(condition: Callable[[], bool], evidence: Callable[[], str]) -> None:
    deadline = time.monotonic() + _START_TIMEOUT_S
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError(evidence())
        time.sleep(0.05)
