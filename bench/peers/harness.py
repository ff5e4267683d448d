"""What all peers share: the trials, processes that start at once, and the clock. It needs nothing but NumPy."""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PHYSICS_HZ, RECORD_HZ = 500, 250
STRIDE = PHYSICS_HZ // RECORD_HZ
BASE_HEIGHT_M = 0.8
BALL_KG, BALL_RADIUS_M = 0.045, 0.025
TCP_M = 0.1034
"""From the origin of the hand of a Panda to the middle between its fingertips, along +z."""


class Trial(NamedTuple):
    """A motion of the arm, and how long the ball flies.

    Attributes:
        positions: Commands of the 7 joints in every physics step, the first one at the start [rad]; its shape is
            ``(n_steps + 1, 7)``, and `n_steps` is a multiple of `STRIDE`.
        release: Physics step in which the gripper opens.
    """

    positions: Floats
    release: int


Run = Callable[[list[Trial]], list[Floats]]
"""Simulates trials; of each, the samples at 250 Hz without the first: shape ``(n_steps / STRIDE, 27)``, with position
[rad] and velocity [rad/s] of 7 joints, and of the ball position [m], quaternion, velocity [m/s] and angular velocity.
"""


def read_trials(path: str) -> list[Trial]:
    """Read what `bench.peers` has written."""
    with np.load(path) as stored:
        return [
            Trial(positions[: steps + 1], release)
            for positions, steps, release in zip(
                stored["positions"], stored["steps"].tolist(), stored["releases"].tolist(), strict=True
            )
        ]


def one_by_one(throw: Callable[[Trial], Floats]) -> Run:
    """Make what simulates trials in turn."""
    return lambda trials: [throw(trial) for trial in trials]


def _work(
    make_run: Callable[[int], Run], threads: int, trials: list[Trial], core: int | None, pipe: Connection
) -> None:
    if core is not None:
        os.sched_setaffinity(0, {core})
    run = make_run(threads)
    run(trials[:1])
    pipe.send("ready")
    pipe.recv()
    wall, cpu = time.perf_counter(), time.process_time()
    episodes = run(trials)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    pairs = list(zip(trials, episodes, strict=True))
    errors = [np.abs(episode[:, :7] - trial.positions[STRIDE::STRIDE]).max() for trial, episode in pairs]
    ways = [np.hypot(*(episode[-1, 14:16] - episode[trial.release // STRIDE, 14:16])) for trial, episode in pairs]
    pipe.send((wall, cpu, float(np.median(errors)), float(np.median(ways))))


def main(make_run: Callable[[int], Run], *, in_threads: bool = False) -> None:
    """Measure a peer as the command line says: FILE of trials, number at once, throws of each; print JSON.

    Args:
        make_run: Loads the world, once in each process; takes the number of threads.
        in_threads: Trials at once are those of threads of one process, not those of processes.
    """
    trials, at_once, throws = read_trials(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    processes, threads = (1, at_once) if in_threads else (at_once, 1)
    cores = sorted(os.sched_getaffinity(0))
    context = multiprocessing.get_context("spawn")
    pipes, count = [], throws * threads
    for index in range(processes):
        # Bound to cores where simulations of throwcollect are, and the raw loops.
        core = cores[index] if processes == len(cores) else None
        share = [trials[(index * count + number) % len(trials)] for number in range(count)]
        pipe, other = context.Pipe()
        context.Process(target=_work, args=(make_run, threads, share, core, other), daemon=True).start()
        other.close()
        pipes.append(pipe)
    # A process that failed has closed its end, which raises an error here.
    for pipe in pipes:
        pipe.recv()
    for pipe in pipes:
        pipe.send("go")
    walls, cpus, errors, ways = zip(*(pipe.recv() for pipe in pipes), strict=True)
    found = {
        "throws_per_s": sum(count / wall for wall in walls),
        "cpu_ms_per_throw": sum(cpus) / (processes * count) * 1e3,
        "tracking_error_rad": max(errors),
        "flight_m": min(ways),
    }
    print(json.dumps(found))
