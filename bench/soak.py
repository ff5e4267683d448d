"""Thousands of goals in sequence to one limb of one simulation: how fast, and whether memory or threads grow.

``python -m bench.soak`` runs it alone.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from rclzenoh.session_config import OVERRIDE_VARIABLE
from throwcollect import ros
from throwcollect.config.schema import Config
from throwcollect.robots.description import start_posture
from throwcollect.robots.talos import TALOS
from throwcollect.ros.router import router

GOALS, WARM = 5000, 1000
MOST_GROWTH_MB = 2.0
"""Between the warm simulation and the end; less than 1 kB a goal."""

_NAME, _LIMB = "sim_0", "arm_right_controller"
_JOINT, _AMPLITUDE_RAD = "arm_right_4_joint", 0.01
_GOAL_MS = 20
_PATIENCE_S = 30.0
_FJT: Any = ros.get_action("control_msgs/action/FollowJointTrajectory")
_Point: Any = ros.get_message("trajectory_msgs/msg/JointTrajectoryPoint")


@dataclass(frozen=True)
class Look:
    """The process of the simulation at one moment.

    Attributes:
        goals: Goals that have ended by then.
        seconds: Time since the first goal [s].
        memory_mb: Resident memory [MB].
        threads: Number of threads.
    """

    goals: int
    seconds: float
    memory_mb: float
    threads: int


def measure(goals: int = GOALS) -> list[Look]:
    """Looks at the start, after `WARM` goals, and at the end.

    Raises:
        RuntimeError: If a goal is not reached, or memory or threads grow.
    """
    with tempfile.TemporaryDirectory(prefix="throwcollect-soak-") as scratch, router("tcp/127.0.0.1:0") as endpoint:
        os.environ[OVERRIDE_VARIABLE] = f"connect/endpoints={json.dumps([endpoint])}"
        config = Path(scratch) / "soak.yaml"
        config.write_text("name: soak\n")
        process = subprocess.Popen([sys.executable, "-m", "throwcollect", "sim", config, "--name", _NAME])
        ros.init()
        try:
            looks = _send(goals, psutil.Process(process.pid))
        finally:
            ros.shutdown()
            process.terminate()
            process.wait()
    _, warm, end = looks
    if end.memory_mb - warm.memory_mb > MOST_GROWTH_MB or end.threads > warm.threads:
        raise RuntimeError(f"the simulation grows: {warm} to {end}")
    return looks


def _send(goals: int, process: psutil.Process) -> list[Look]:
    node = ros.Node("soak")
    executor = ros.SingleThreadedExecutor()
    executor.add_node(node)
    client = ros.ActionClient(node, _FJT, f"/{_NAME}/{_LIMB}/follow_joint_trajectory")
    _wait(executor, client.server_is_ready)
    began = time.monotonic()

    def look(done: int) -> Look:
        memory_mb = process.memory_info().rss / 1e6
        return Look(done, time.monotonic() - began, memory_mb, process.num_threads())

    looks = [look(0)]
    for number in range(1, goals + 1):
        sent = client.send_goal_async(_goal(_AMPLITUDE_RAD if number % 2 else 0.0))
        _wait(executor, sent.done)
        handle = sent.result()
        ended = handle.get_result_async() if handle.accepted else None
        if ended is None:
            raise RuntimeError(f"goal {number} was rejected")
        _wait(executor, ended.done)
        if ended.result().result.error_code != 0:
            raise RuntimeError(f"goal {number} was not reached: {ended.result()!r}")
        if number in (WARM, goals):
            looks.append(look(number))
    return looks


def _goal(offset_rad: float) -> Any:
    posture, goal = start_posture(Config(name="soak")), _FJT.Goal()
    joints = TALOS.controllers[_LIMB]
    positions = [posture[joint] + (offset_rad if joint == _JOINT else 0.0) for joint in joints]
    point = _Point(positions=positions)
    point.time_from_start.nanosec = _GOAL_MS * 10**6
    goal.trajectory.joint_names = list(joints)
    goal.trajectory.points = [point]
    return goal


def _wait(executor: ros.Executor, condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + _PATIENCE_S
    while not condition():
        if time.monotonic() > deadline:
            raise RuntimeError("the simulation does not answer")
        executor.spin_once(timeout_sec=0.1)


def show(looks: list[Look]) -> None:
    """Print looks as a table."""
    print("\n## Goals in sequence to one limb\n")
    print("| goals | goals/s | memory | threads |\n|---|---|---|---|")
    for before, look in zip([looks[0], *looks], looks, strict=False):
        rate = f"{(look.goals - before.goals) / (look.seconds - before.seconds):.0f}" if look.goals else ""
        print(f"| {look.goals} | {rate} | {look.memory_mb:.1f} MB | {look.threads} |", flush=True)


if __name__ == "__main__":
    show(measure())
