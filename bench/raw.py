"""The raw limit: the same physics in a bare pybullet loop, without ROS, without files, without checks."""

from __future__ import annotations

import multiprocessing
import os
import time
from multiprocessing.synchronize import Barrier

import numpy as np
import pybullet

from throwcollect.config.schema import Config
from throwcollect.robots.description import physics_description
from throwcollect.robots.limits import joint_limits
from throwcollect.robots.quintic_curve import sample_quintic
from throwcollect.robots.talos import TALOS
from throwcollect.sim.world import World
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.task import task_of

Commands = tuple[list[list[float]], list[list[float]]]


def commands_of(config: Config, moving: tuple[str, ...]) -> Commands:
    """Positions and feed-forward velocities of every physics step of a trial, until its longest duration."""
    trajectory = task_of(config).trajectory()
    steps = int(config.sim.max_trial_s * config.sim.physics_hz)
    times = np.minimum(np.arange(steps + 1) / config.sim.physics_hz, trajectory.times[-1])
    positions = sample_quintic(trajectory, times)[0]
    positions = positions[:, [trajectory.joints.index(joint) for joint in moving]]
    velocities = np.diff(positions, axis=0) * config.sim.physics_hz
    return positions.tolist(), velocities.tolist()


def throw(world: World, state: int, commands: Commands, config: Config, forces: list[float]) -> int:
    """Run one trial the barest way; returns the number of steps."""
    engine = world.engine
    robot, joints, ball = engine._scenery.robot, engine._scenery.joints, engine._ball
    hz, stride = config.sim.physics_hz, config.sim.physics_hz // config.record.rate_hz
    gains, damping = [config.robot.position_gain_per_s / hz] * len(joints), [1.0] * len(joints)
    plane = config.scene.landing_height_m + config.ball.radius_m
    pybullet.restoreState(state)
    positions, velocities = commands
    rows = []
    pressed = True
    for step in range(len(velocities)):
        pybullet.setJointMotorControlArray(
            robot,
            joints,
            pybullet.POSITION_CONTROL,
            targetPositions=positions[step],
            targetVelocities=velocities[step],
            forces=forces,
            positionGains=gains,
            velocityGains=damping,
        )
        pybullet.stepSimulation()
        pressed = any(point[9] > 0 for point in pybullet.getContactPoints(ball))
        if (step + 1) % stride == 0:
            pose = pybullet.getBasePositionAndOrientation(ball)
            rows.append((pybullet.getJointStates(robot, joints), pose, pybullet.getBaseVelocity(ball)))
            if pose[0][2] < plane and not pressed:
                break
    return step + 1


def _loop(
    plan: Plan, numbers: list[int], barrier: Barrier, seconds: multiprocessing.Queue[float], core: int | None
) -> None:
    if core is not None:
        os.sched_setaffinity(0, {core})
    world = World(plan.config)
    limits = joint_limits(TALOS).effort * plan.config.robot.effort_scale
    forces = [float(limits[TALOS.joints.index(joint)]) for joint in world.moving]
    trials = [plan.config_of(plan.trials[number]) for number in numbers]
    prepared = [(config, commands_of(config, physics_description(config).moving)) for config in trials]
    state = pybullet.saveState()
    throw(world, state, prepared[0][1], prepared[0][0], forces)
    barrier.wait()
    began = time.perf_counter()
    for config, commands in prepared:
        throw(world, state, commands, config, forces)
    seconds.put(time.perf_counter() - began)


def measure(plan: Plan, processes: int, trials: int) -> float:
    """Throws per second of bare loops in several processes at once.

    Args:
        plan: Feasible trials, of which the first ones are run, again and again.
        processes: Number of processes.
        trials: Trials of each process.
    """
    feasible = [trial.number for trial in plan.trials if trial.refused is None]
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(processes)
    seconds: multiprocessing.Queue[float] = context.Queue()
    workers = []
    # Bound to cores where the collection's simulations are, so that the limit has the same advantage.
    cores = sorted(os.sched_getaffinity(0))
    for index in range(processes):
        core = cores[index % len(cores)] if processes >= len(cores) else None
        numbers = [feasible[(index * trials + k) % len(feasible)] for k in range(trials)]
        workers.append(context.Process(target=_loop, args=(plan, numbers, barrier, seconds, core)))
    for worker in workers:
        worker.start()
    durations = [seconds.get() for _ in workers]
    for worker in workers:
        worker.join()
    return sum(trials / duration for duration in durations)
