"""The raw limit: the same physics in a bare loop of the engine's own calls, without ROS, files and checks."""

from __future__ import annotations

import multiprocessing
import os
import time
from importlib import import_module
from multiprocessing.synchronize import Barrier
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.plan.plan import Plan
from throwcollect.robots.description import physics_description, robot_of, start_posture
from throwcollect.robots.robot import joint_limits
from throwcollect.robots.trajectory import sample_quintic
from throwcollect.sim.world import World
from throwcollect.tasks.task import task_of


class Commands(NamedTuple):
    """What the motors of a trial are told in every physics step, until its longest duration.

    Attributes:
        config: Configuration of the trial.
        positions: [rad], shape ``(n_steps + 1, n_moving)``.
        velocities: [rad/s], shape ``(n_steps, n_moving)``.
        efforts: Most torque of each motor [Nm], shape ``(n_moving,)``.
    """

    config: Config
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    efforts: NDArray[np.float64]


def commands_of(config: Config) -> Commands:
    """The commands of a trial."""
    moving = physics_description(config).moving
    trajectory = task_of(config).trajectory()
    steps = int(config.sim.max_trial_s * config.sim.physics_hz)
    times = np.minimum(np.arange(steps + 1) / config.sim.physics_hz, trajectory.times[-1])
    robot, start = robot_of(config), start_posture(config)
    positions = np.tile([start[joint] for joint in moving], (steps + 1, 1))
    positions[:, [moving.index(joint) for joint in trajectory.joints]] = sample_quintic(trajectory, times)[0]
    limits = joint_limits(robot).effort * config.robot.effort_scale
    efforts = limits[[robot.joints.index(joint) for joint in moving]]
    return Commands(config, positions, np.diff(positions, axis=0) * config.sim.physics_hz, efforts)


def _loop(
    plan: Plan,
    numbers: list[int],
    barrier: Barrier,
    seconds: multiprocessing.Queue[tuple[float, float]],
    core: int | None,
) -> None:
    if core is not None:
        os.sched_setaffinity(0, {core})
    world = World(plan.config)
    # Each engine has a module of its own here, as only that of the configuration need be installed.
    throw = import_module(f"bench.raw_{plan.config.sim.engine}").make_throw(world)
    prepared = [commands_of(plan.config_of(plan.trials[number])) for number in numbers]
    throw(prepared[0])
    barrier.wait()
    began, busy = time.perf_counter(), time.process_time()
    for commands in prepared:
        throw(commands)
    seconds.put((time.perf_counter() - began, time.process_time() - busy))


def measure(plan: Plan, processes: int, trials: int) -> tuple[float, float]:
    """Throws per second of bare loops in several processes at once, and the processor time of a throw [ms].

    Args:
        plan: Feasible trials, of which the first ones are run, again and again.
        processes: Number of processes.
        trials: Trials of each process.
    """
    feasible = [trial.number for trial in plan.trials if trial.refused is None]
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(processes)
    seconds: multiprocessing.Queue[tuple[float, float]] = context.Queue()
    started = []
    # Bound to cores where the collection's simulations are, so that the limit has the same advantage.
    cores = sorted(os.sched_getaffinity(0))
    for index in range(processes):
        core = cores[index % len(cores)] if processes >= len(cores) else None
        numbers = [feasible[(index * trials + k) % len(feasible)] for k in range(trials)]
        started.append(context.Process(target=_loop, args=(plan, numbers, barrier, seconds, core)))
    for each in started:
        each.start()
    durations = [seconds.get() for _ in started]
    for each in started:
        each.join()
    walls, busy = zip(*durations, strict=True)
    return sum(trials / wall for wall in walls), sum(busy) / (trials * processes) * 1e3
