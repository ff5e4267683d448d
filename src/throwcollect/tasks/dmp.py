"""Turns weights of discrete dynamic movement primitives in joint space into a trajectory, and a motion into weights.

With goal g and time constant tau, each joint y follows::

    tau z' = alpha_z (beta_z (g - y) - z) + f(x)      beta_z = alpha_z / 4
    tau y' = z
    tau x' = -alpha_x x,  x(0) = 1
    f(x)   = sum(psi_i(x) w_i) / sum(psi_i(x)) x      psi_i(x) = exp(-(x - c_i)² / (2 sigma2_i))

The N centres ``c_i = exp(-alpha_x (i - 1) / (N - 1))`` are evenly spaced in time over one tau, and the widths are
``sigma2_i = (0.75 (c_{i+1} - c_i))²``, the last one repeated. The forcing term is not scaled with the amplitude
g - y(0): weights belong to the motion that they were learned from, and a joint that returns to where it started can
move in between.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.motion import DynamicMovementPrimitive
from throwcollect.errors import ConfigError
from throwcollect.reproducible_math import exp, matmul
from throwcollect.robots.trajectory import JointTrajectory, sample_quintic
from throwcollect.wording import join_names

_SETTLED_RAD = 1e-3
_SETTLED_RADPS = 5e-3
_BLEND_S = 0.2
_HORIZON_TAU = 5.0
FIT_POINTS = 501
"""Points of a motion that weights are fitted to."""


def dmp_trajectory(
    start: Mapping[str, float],
    end: Mapping[str, float],
    *,
    duration_s: float,
    family: DynamicMovementPrimitive,
    points_hz: float,
) -> JointTrajectory:
    """Compute points on the motion of a DMP, which ends at rest at its goal.

    A DMP only approaches its goal. Points follow it until every joint stays within 1 mrad and 5 mrad/s of rest at
    the goal; one more point at rest, exactly at the goal and at least 0.2 s later, ends the trajectory. The last
    segment thus leaves the DMP by about 1 mrad at most, with an acceleration of some 0.3 rad/s² at most.

    Args:
        start: Angle [rad] of at least each joint of `end`.
        end: Goal [rad] of each moving joint; its order is that of the trajectory's joints.
        duration_s: Time constant tau [s]. The motion lasts longer than that until it has settled.
        family: Weights and constants of the DMP.
        points_hz: Points per second.
    """
    zero = [0.0] * family.basis_functions
    weights = np.array([family.weights.get(joint, zero) for joint in end])
    origin = np.array([start[joint] for joint in end])
    goal = np.array(list(end.values()))
    times = np.arange(2 + math.ceil(_HORIZON_TAU * duration_s * points_hz)) / points_hz
    # Numbers that overflow are refused below.
    with np.errstate(all="ignore"):
        motion = roll_out(times, start=origin, goal=goal, weights=weights, tau=duration_s, family=family)
    positions, velocities, accelerations = motion
    finite = np.isfinite(motion)
    if wrong := [joint for number, joint in enumerate(end) if not finite[:, :, number].all()]:
        raise ConfigError(
            f"the DMP of {join_names(wrong)} leads to numbers that are not finite",
            hint="set smaller weights, or a task.trajectory.alpha_x nearer to 2",
        )
    moving = (np.abs(positions - goal) > _SETTLED_RAD) | (np.abs(velocities) > _SETTLED_RADPS)
    if moving[-1].any():
        joint = int(np.argmax(np.abs(velocities[-1]) / _SETTLED_RADPS + np.abs(positions[-1] - goal) / _SETTLED_RAD))
        offset, speed = positions[-1, joint] - goal[joint], velocities[-1, joint]
        raise ConfigError(
            f"the DMP of {tuple(end)[joint]} has not settled after {times[-1]:.2f} s: it is {offset:.2g} rad from its "
            f"goal at {speed:.2g} rad/s",
            expected=f"within {_SETTLED_RAD:g} rad and {_SETTLED_RADPS:g} rad/s",
            hint="give its last basis functions weights near 0, or set a larger task.trajectory.alpha_x",
        )
    # Points are kept up to the first one at which all joints have settled.
    kept = min(len(times), int(np.flatnonzero(moving.any(axis=1))[-1]) + 2) if moving.any() else 1
    rest = np.zeros((1, len(goal)))
    return JointTrajectory(
        joints=tuple(end),
        times=np.append(times[:kept], times[kept - 1] + max(_BLEND_S, 1 / points_hz)),
        positions=np.vstack([positions[:kept], goal]),
        velocities=np.vstack([velocities[:kept], rest]),
        accelerations=np.vstack([accelerations[:kept], rest]),
    )


def roll_out(
    times: NDArray[np.float64],
    *,
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    weights: NDArray[np.float64],
    tau: float,
    family: DynamicMovementPrimitive,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Compute the motion of a DMP that starts at rest, by the classical Runge-Kutta method with exact phase.

    The step resolves the fastest time scale of both the transformation system and the basis functions, which keeps
    positions within 1e-7 rad per rad of motion.

    Args:
        times: Evenly spaced times [s] from 0, shape ``(n,)`` with at least two.
        start: Joint angles at the start [rad], shape ``(n_joints,)``.
        goal: Goals [rad], shape ``(n_joints,)``.
        weights: [rad], shape ``(n_joints, n_basis_functions)``.
        tau: Time constant [s].
        family: Constants of the DMP; its weights are ignored.

    Returns:
        Positions [rad], velocities [rad/s] and accelerations [rad/s²], each of shape ``(n, n_joints)``.
    """
    spacing = float(times[1] - times[0])
    rate = max(250.0, 5 * family.alpha_z, 8 * family.basis_functions)
    substeps = math.ceil(spacing / tau * rate)
    # A step of Runge-Kutta takes the forcing term at its beginning, its middle and its end.
    halves = np.arange(2.0 * substeps * (len(times) - 1) + 1) * (spacing / (2 * substeps))
    phase = exp(-family.alpha_x / tau * halves)
    forcing = matmul(basis(phase, count=family.basis_functions, alpha_x=family.alpha_x), weights.T)
    # With the state (y - g, tau y') and the step in units of tau, the system is linear and constant.
    system = np.array([[0.0, 1.0], [-(family.alpha_z**2) / 4, -family.alpha_z]])
    step = system * (spacing / tau / substeps)
    square = matmul(step, step)
    cube, fourth = matmul(square, step), matmul(square, square)
    unit = np.eye(2)
    # For a linear system, the method of Runge-Kutta is the Taylor polynomial of the matrix exponential to order four.
    transition = unit + step + square / 2 + cube / 6 + fourth / 24
    # These are the effects on the state of the forcing term at the beginning, the middle and the end of a step. The
    # forcing term pushes only the second number of the state, hence the last column.
    inputs = np.stack([unit + step + square / 2 + cube / 4, 4 * unit + 2 * step + square / 2, unit], axis=1)[..., 1]
    samples = np.stack([forcing[:-1:2], forcing[1::2], forcing[2::2]], axis=1)
    drive = matmul(inputs * (spacing / tau / substeps / 6), samples)
    (yy, yz), (zy, zz) = transition.tolist()

    def following(state: tuple[float, float], push: list[float]) -> tuple[float, float]:
        y, z = state
        return yy * y + yz * z + push[0], zy * y + zz * z + push[1]

    # The joints are computed one after the other in plain numbers, because arrays of two numbers would be slower.
    drives = zip(drive.transpose(2, 0, 1).tolist(), (start - goal).tolist(), strict=True)
    states = np.array([list(accumulate(pushes, following, initial=(offset, 0.0))) for pushes, offset in drives])
    offsets, speeds = np.moveaxis(states[:, ::substeps], (0, 1, 2), (2, 1, 0))
    # This is the equation for tau z'; y - g and z are the two numbers of the state.
    push = forcing[:: 2 * substeps] - family.alpha_z * (family.alpha_z / 4 * offsets + speeds)
    return goal + offsets, speeds / tau, push / tau**2


def basis(phase: NDArray[np.float64], *, count: int, alpha_x: float) -> NDArray[np.float64]:
    """Compute the normalised basis functions times the phase x, shapes ``(n, count)`` and ``(n,)``.

    The forcing term is their product with the weights.
    """
    centres, variances = kernels(count=count, alpha_x=alpha_x)
    exponents = (phase[:, None] - centres) ** 2 / (-2 * variances)
    # Far from all centres, every psi would underflow, but only their ratios matter, so this makes the largest psi 1.
    psi = exp(exponents - exponents.max(axis=1, keepdims=True))
    weighted: NDArray[np.float64] = psi * (phase / psi.sum(axis=1))[:, None]
    return weighted


def kernels(*, count: int, alpha_x: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute centres ``c_i`` and squared widths ``sigma2_i`` of the basis functions, each of shape ``(count,)``."""
    centres = exp(-alpha_x * np.linspace(0, 1, count))
    widths = (0.75 * np.diff(centres)) ** 2
    return centres, np.append(widths, widths[-1])


def fit_motions(motions: Sequence[JointTrajectory], *, basis_functions: int) -> list[DynamicMovementPrimitive]:
    """Find the weights with which a DMP repeats each motion, by least squares over all basis functions.

    A DMP starts at the first position of its motion; its goal is the last one and its tau the duration of the motion,
    which should start and end at rest. Its other constants have their defaults. All motions are fitted by one
    decomposition: stretched to a duration of 1, they have the same phases.
    """
    if not motions:
        return []
    family = DynamicMovementPrimitive(family="dmp", basis_functions=basis_functions)
    alpha_z, shares = family.alpha_z, np.linspace(0, 1, FIT_POINTS)
    targets = []
    for motion in motions:
        tau = motion.times[-1]
        positions, velocities, accelerations = sample_quintic(motion, shares * tau)
        # These are the equations above, solved for the forcing term that the motion needs.
        spring = alpha_z * (alpha_z / 4 * (positions[-1] - positions) - tau * velocities)
        targets.append(tau**2 * accelerations - spring)
    features = basis(exp(-family.alpha_x * shares), count=basis_functions, alpha_x=family.alpha_x)
    columns = iter(np.linalg.lstsq(features, np.hstack(targets), rcond=None)[0].T.tolist())
    # The iterator goes on from motion to motion.
    weights = [dict(zip(motion.joints, columns, strict=False)) for motion in motions]
    return [family.model_copy(update={"weights": each}) for each in weights]
