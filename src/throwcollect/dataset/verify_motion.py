"""Checks the motion of robot and ball in an episode: what the simulation cannot have recorded.

The tolerances are far above the errors of honest recordings with all settings, and far below changes that are worth a
forgery.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.dataset.recorded_trial import RecordedTrial
from throwcollect.robots.description import find_locked_joints, robot_of, start_posture
from throwcollect.robots.limits import joint_limits
from throwcollect.robots.motor_lag import lag_behind
from throwcollect.robots.quintic_curve import sample_positions
from throwcollect.tasks.free_flight import ballistic_steps

_POSITION_M = 1e-11
_VELOCITY_MPS = 1e-10
_SPIN = 1e-10
"""Share of the angular velocity, or [rad/s] if that is below 1 rad/s."""
_ORIENTATION_RAD = 1e-9
_UNIT = 1e-9
_MOST_TURN_RAD = 0.75
"""The physics turns a body by at most an eighth of a turn a step, so faster spins are not compared."""
_AFTER_CONTACT_S = 0.02
_AFTER_CONTACT_STEPS = 10
"""The contact solver may act on a ball for some steps after its normal force has gone: up to 12 ms were seen."""
_REACH_M = 0.02
"""Distance at which Bullet lets bodies press on each other already."""
_FOLLOW_RAD = 0.02
"""With the default gains, motors that are not saturated stay within 0.0002 rad of their commands."""
_AT_LIMIT = 0.999
_CHANGE_RADPS2 = 50.0
"""How fast a joint's velocity may leave, between two samples, the range between the velocities of both; more where
motors follow less well. Up to 4 rad/s² were seen, and a motion without its velocities is off by hundreds."""


def find_joint_problems(trial: RecordedTrial) -> Iterator[str]:
    """Find what the joints cannot have done, a sentence each."""
    samples, config, trajectory = trial.samples, trial.config, trial.trajectory
    robot = robot_of(config)
    locked = find_locked_joints(config)
    lowest, highest = samples.position.min(axis=0).tolist(), samples.position.max(axis=0).tolist()
    torques, limits = np.abs(samples.effort), joint_limits(robot).effort * config.robot.effort_scale
    most = torques.max(axis=0)
    moved = np.maximum(most, np.abs(samples.velocity).max(axis=0)).tolist()
    for joint, low, high, motion in zip(robot.joints, lowest, highest, moved, strict=True):
        if joint in locked and not low == locked[joint] == high:
            yield f"{joint} is locked at {locked[joint]:.6g} rad and is somewhere else"
        if joint in locked and motion:
            yield f"{joint} is locked, and moves or has a torque"
    peaks = most / limits
    if peaks.max() > 1 + 1e-6:
        joint = robot.joints[int(peaks.argmax())]
        yield f"the torque of {joint} is {peaks.max():.4f} of the most that its motor has"
    tolerance = _compute_following_tolerance(config)
    apart = np.abs(samples.position[0] - list(start_posture(config).values()))
    if apart.max() > tolerance:
        joint = robot.joints[int(apart.argmax())]
        yield f"{joint} starts {apart.max():.3g} rad away from the start posture of the trial"
    if trial.has_failed_goal:
        return
    # A motor at its limit falls behind, so from there on honest recordings depart from the trajectory, too.
    followed = len(samples)
    if peaks.max() >= _AT_LIMIT:
        followed = int((torques / limits >= _AT_LIMIT).any(axis=1).argmax())
    wanted = _compute_motor_positions(trial)[:followed]
    moving = [robot.joints.index(joint) for joint in trajectory.joints]
    # In memory, the numbers of a joint lie side by side, so whole rows of the transposed arrays are copied.
    positions, velocities = samples.position.T[moving].T[:followed], samples.velocity.T[moving].T[:followed]
    errors = np.abs(positions - wanted)
    if followed and errors.max() > tolerance:
        joint = trajectory.joints[int(errors.max(axis=0).argmax())]
        said = f"departs from the trajectory of the trial by {errors.max():.3g} rad"
        yield f"{joint} {said}, although its torque is below its limit"
    excess = _measure_velocity_excess(positions, velocities, trial)
    if excess.size and excess.max() > _CHANGE_RADPS2 * tolerance / _FOLLOW_RAD:
        joint = trajectory.joints[int(excess.max(axis=0).argmax())]
        yield f"{joint} moves otherwise than its velocities say"


def _measure_velocity_excess(
    positions: NDArray[np.float64], velocities: NDArray[np.float64], trial: RecordedTrial
) -> NDArray[np.float64]:
    """Measure by how much the mean velocity from one sample to the next is outside the range of their velocities.

    Returns:
        Excess by the time between samples [rad/s²], negative inside the range, shape ``(n_samples - 1, n_joints)``.
    """
    hz = trial.config.record.rate_hz
    middle, half = (velocities[1:] + velocities[:-1]) / 2, np.abs(velocities[1:] - velocities[:-1]) / 2
    excess: NDArray[np.float64] = (np.abs((positions[1:] - positions[:-1]) * hz - middle) - half) * hz
    return excess


def _compute_motor_positions(trial: RecordedTrial) -> NDArray[np.float64]:
    """Compute where motors are that follow their commands, at each sample [rad], shape ``(n_samples, n_moving)``."""
    config, trajectory = trial.config, trial.trajectory
    speed, lag_s, hz = config.robot.speed_scale, config.robot.motor_lag_s, config.sim.physics_hz
    if not lag_s:
        times = (trial.times_s - config.sim.command_delay_s) * speed
        return sample_positions(trajectory, np.maximum(times, 0.0))
    stride = hz // config.record.rate_hz
    # The lag acts in each physics step, so all steps are computed, and those of the samples chosen from them.
    times = (np.arange(1, stride * (len(trial.samples) - 1) + 1) / hz - config.sim.command_delay_s) * speed
    start = sample_positions(trajectory, np.zeros(1))
    reached = lag_behind(sample_positions(trajectory, np.maximum(times, 0.0)), start[0], hz=hz, lag_s=lag_s)
    return np.concatenate([start, reached[stride - 1 :: stride]])


def _compute_following_tolerance(config: Config) -> float:
    """Compute how far a motor may be from its command without being saturated [rad]: weak gains follow less well."""
    robot = config.robot
    weak = max(1.0, 100 / robot.position_gain_per_s) * max(1.0, 1 / robot.velocity_gain) ** 2
    return _FOLLOW_RAD * weak * max(1.0, 10 / config.sim.solver_iterations)


def find_ball_problems(trial: RecordedTrial) -> Iterator[str]:
    """Find what the ball cannot have done, given its contacts.

    From one sample to the next, the motion of a ball that nothing touches follows from the physics, except for
    rounding; the motion of a ball that something presses on does not.

    Yields:
        What is wrong, a sentence each.
    """
    samples = trial.samples
    off_unit = np.abs(_measure_lengths(samples.ball_orientation_xyzw) - 1).max()
    # Unlike `>`, `not <=` is true for NaN, too.
    if not off_unit <= _UNIT:
        yield f"the ball's orientation is no unit quaternion: its length is off by {off_unit:.3g}"
        return
    if len(samples) < 2:
        return
    departures = _measure_departures(trial)
    free = _find_free_intervals(trial)
    for what, (values, tolerance, unit) in departures.items():
        # A departure that overflows to NaN counts as one.
        wrong = free & ~(values <= tolerance)
        if wrong.any():
            place = f"first at {trial.times_s[int(wrong.argmax()) + 1]:.3f} s, where no contact is"
            yield f"the ball's {what} departs from ballistic motion by {values[wrong].max():.3g} {unit}, {place}"
    velocity, tolerance, _ = departures["velocity"]
    for contact in trial.header.contacts:
        interval = trial.steps_of(contact)
        if interval is None:
            continue
        first, touched, held = _find_intervals(interval, trial)
        # If a contact is too short to fill an interval, one of the intervals that it touches must show it.
        moved = (
            velocity[held] > tolerance if held.stop > held.start else np.array([velocity[touched].max()]) > tolerance
        )
        what = trial.name_contact(contact)
        if interval[1] > 1 and not moved.all():
            yield f"{what}: the ball moves as if nothing touched it"
        if contact.body == "ground" and (problem := _explain_off_ground(trial, first)):
            yield f"{what}: {problem}"


def _find_intervals(contact: tuple[int, int], trial: RecordedTrial) -> tuple[int, slice, slice]:
    """Find the first sample at or after the start of a contact, and the intervals that it touches and those it fills.

    The contact is given in steps. Interval k has the steps after sample k, up to and including that of sample k + 1.
    """
    stride = trial.stride
    # Step 0 is the first sample itself and in no interval, so a contact counts from step 1 on.
    first, end = max(contact[0], 1), max(contact[1], 2)
    last = trial.last_step // stride
    touched = slice((first - 1) // stride, min(last, (end - 2) // stride + 1))
    held = slice(-(-(first - 1) // stride), (end - 1) // stride)
    return min(-(-contact[0] // stride), last), touched, held


def _find_free_intervals(trial: RecordedTrial) -> NDArray[np.bool_]:
    """Find the intervals between samples in which no contact acts, shape ``(n_samples - 1,)``."""
    after = max(math.ceil(_AFTER_CONTACT_S * trial.config.sim.physics_hz), _AFTER_CONTACT_STEPS)
    begins = np.arange(0, trial.last_step, trial.stride)
    free = np.ones(len(begins), dtype=bool)
    for interval in map(trial.steps_of, trial.header.contacts):
        if interval is not None:
            free &= (begins + trial.stride < interval[0]) | (begins >= interval[1] + after)
    return free


def _measure_departures(
    trial: RecordedTrial,
) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64] | float, str]]:
    """Measure how far each sample is from the ballistic continuation of the one before; with tolerance and unit."""
    samples, stride, config = trial.samples, trial.stride, trial.config
    position, velocity = ballistic_steps(
        samples.ball_position[:-1], samples.ball_linear_velocity[:-1], steps=stride, config=config
    )
    spin, orientation = samples.ball_angular_velocity, samples.ball_orientation_xyzw
    rate = _measure_lengths(spin[:-1])
    turned = _turn(orientation[:-1], spin[:-1], stride / config.sim.physics_hz)
    # A quaternion and its negative are the same orientation.
    cosine = _multiply_rows(turned, orientation[1:])
    apart = 2 * _measure_lengths(turned * np.sign(cosine)[:, np.newaxis] - orientation[1:])
    apart[rate > _MOST_TURN_RAD * config.sim.physics_hz] = 0.0
    return {
        "position": (_measure_lengths(samples.ball_position[1:] - position), _POSITION_M, "m"),
        "velocity": (_measure_lengths(samples.ball_linear_velocity[1:] - velocity), _VELOCITY_MPS, "m/s"),
        "spin": (_measure_lengths(spin[1:] - spin[:-1]), _SPIN * np.maximum(rate, 1.0), "rad/s"),
        "orientation": (apart, _ORIENTATION_RAD, "rad"),
    }


def _turn(orientation: NDArray[np.float64], spin: NDArray[np.float64], duration_s: float) -> NDArray[np.float64]:
    """Turn unit quaternions (xyzw) with constant angular velocities in world [rad/s]; shape ``(n, 4)``."""
    half = _measure_lengths(spin) * (duration_s / 2)
    # sin(x)/x, also where nothing turns.
    ax, ay, az = spin.T * (duration_s / 2 * np.sinc(half / np.pi))
    qx, qy, qz, qw = orientation.T
    turn = np.cos(half)
    # This is the product of two quaternions, that of the turn and the orientation.
    return np.array(
        [
            turn * qx + qw * ax + ay * qz - az * qy,
            turn * qy + qw * ay + az * qx - ax * qz,
            turn * qz + qw * az + ax * qy - ay * qx,
            turn * qw - ax * qx - ay * qy - az * qz,
        ]
    ).T


def _multiply_rows(left: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the scalar product of each row with the same row of the other array, shape ``(n,)``."""
    # `sum` and `norm` over an axis of three or four take several times as long.
    products: NDArray[np.float64] = np.einsum("ij,ij->i", left, right)
    return products


def _measure_lengths(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the length of each row, shape ``(n,)``."""
    lengths: NDArray[np.float64] = np.sqrt(_multiply_rows(rows, rows))
    return lengths


def _explain_off_ground(trial: RecordedTrial, first: int) -> str | None:
    """Say why a contact with the ground cannot begin by this sample; None if it can."""
    config, samples = trial.config, trial.samples
    if not config.scene.landing_height_m > 0:
        return "the ground stops nothing, as the landing plane is on it"
    gap = float(samples.ball_position[first, 2]) - config.ball.radius_m
    moved = abs(float(samples.ball_linear_velocity[first, 2])) * trial.stride / config.sim.physics_hz
    return f"the ball is {gap:.3g} m above the ground" if gap > moved + _REACH_M else None
