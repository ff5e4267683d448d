"""The loop over the steps of a MuJoCo world, as arithmetic on memory; `loop` compiles it, or leaves it to Python.

So that both compute the same bits, these functions have nothing but numbers, loops and memory, which is an address for
compiled functions, and a `memoryview` or an array for others.
"""

from __future__ import annotations

import math
from typing import Any

from mujoco import mj_rne, mj_step1, mj_step2, mjtDisableBit

World = Any
Floats = Any
Ints = Any
Words = Any
"""A structure of MuJoCo, and memory of numbers with 64, 32 and 64 bits; `loop` reads these names in signatures."""

SLIDING_ROWS, ROLLING_ROWS = 3, 6
"""Rows of a contact: one along its normal and two of sliding friction; with rolling friction, three more."""

HARDNESS = 0.9
"""Share of its target acceleration that a contact reaches; the higher it is, the longer the solver takes."""

_CORRECTED = 0.2
"""Share of a penetration that one step removes, as in Bullet."""

_LEAST_BOUNCE_MPS = 0.2
"""Contacts with a lower approach speed do not bounce, as in Bullet."""

_SPARE_M = 0.05
"""The object is not expected to come closer by this distance in one step."""

_SPLIT = 134217729.0
"""2^27 + 1, which splits a number into two of half its digits."""

_PRESS = 3
"""Each contact sensor has three numbers, of which the first is the normal force."""

EMPTY = int(mjtDisableBit.mjDSBL_CONTACT | mjtDisableBit.mjDSBL_SENSOR)
"""Flags of a world in which nothing is looked for that touches the object."""

VERSION = "4.0.0"
"""The MuJoCo whose structures have the places below."""

# Places of fields, counted in numbers: of the flags behind the gravity in `mjOption`, of the number of contacts and of
# addresses in `mjData`; and in `mjContact` its size, its two shapes, and its row along the normal.
FLAGS = 56
NCON, ARENA, CONTACT, EFC_POS, EFC_VEL, EFC_AREF = 40140, 20085, 20186, 20194, 20235, 20236
CONTACT_SIZE, GEOM, EFC_ADDRESS = 152, 141, 150


def take_steps(
    model: World,
    data: World,
    options: Ints,
    data_ints: Ints,
    data_words: Words,
    arena: Floats,
    arena_ints: Ints,
    origin: int,
    qpos: Floats,
    qvel: Floats,
    qacc: Floats,
    qacc_warmstart: Floats,
    qfrc_passive: Floats,
    qfrc_constraint: Floats,
    qfrc_applied: Floats,
    qfrc_inverse: Floats,
    sensordata: Floats,
    xipos: Floats,
    ximat: Floats,
    boxes: Floats,
    roots: Ints,
    motors: Floats,
    bounces: Floats,
    order: Words,
    samples: Floats,
    states: Floats,
    changes: Words,
    pressing: Words,
    joints: int,
    bodies: int,
    surfaces: int,
    watched: int,
    wanted: Floats,
    first: int,
    last: int,
    due: int,
    stride: int,
    hz: float,
    drag_kgpm: float,
    reach_m: float,
    plane_m: float,
) -> int:
    """Take the steps from number `first` to before `last`; without any, only aim the contacts.

    In one step, a motor gives its joint the velocity that Bullet's motor would give it. Inverse dynamics of the present
    state give the torque for that, with the contact forces of the step before and within the efforts. So the solver
    finds contacts for the motion that the tool really has.

    The first arguments are MuJoCo's: its structures, also as integers (`options` from gravity on), its arena from the
    address `origin` on, and fields, of which `boxes` is ``bvh_aabb`` and `roots` ``body_bvhadr``. `motors` has by which
    position, velocity and, for its damping, acceleration of each joint are multiplied, and its effort; `wanted` its
    acceleration in each step, at position and velocity 0; `bounces` the restitution of each shape; `order` the place of
    each joint of a sample. The object may touch the first `watched` bodies, within `reach_m` of its centre; `bodies`
    move, with the object. From step `due` on, `samples` gets samples until the object falls through the height
    `plane_m`, and `states` what the world would go on from; `changes` gets their number, and what presses then.

    Returns:
        Number of steps up to the last one.
    """
    count, sample, state, reached = 0, 0, 0, first
    is_above = qpos[joints + 2] >= plane_m
    if first == last:
        aim_contacts(data_ints, data_words, arena, arena_ints, origin, bounces, hz)
    for step in range(first, last):
        mj_step1(model, data)
        if watched:
            gap = find_gap(qpos[joints], qpos[joints + 1], qpos[joints + 2], xipos, ximat, boxes, roots, watched)
            was_empty = options[FLAGS] & EMPTY
            options[FLAGS] = options[FLAGS] | EMPTY if gap > reach_m + _SPARE_M else options[FLAGS] & ~EMPTY
            if was_empty and gap < reach_m:
                mj_step1(model, data)
        for joint in range(joints):
            # Bullet's motor accelerates by hz (gain (target - position) + share (target velocity - velocity)).
            pull, brake = motors[4 * joint], motors[4 * joint + 1]
            qacc[joint] = wanted[step * joints + joint] - qpos[joint] * pull - qvel[joint] * brake
        mj_rne(model, data, 1, qfrc_inverse)
        for joint in range(joints):
            # Joint damping acts on the velocity after the step.
            lag, most = motors[4 * joint + 2], motors[4 * joint + 3]
            torque = qacc[joint] * lag - qfrc_passive[joint] - qfrc_constraint[joint] + qfrc_inverse[joint]
            qfrc_applied[joint] = most if torque > most else -most if torque < -most else torque
        contacts = data_ints[NCON]
        if contacts:
            aim_contacts(data_ints, data_words, arena, arena_ints, origin, bounces, hz)
        if drag_kgpm:
            factor = -drag_kgpm * measure_length(qvel[joints], qvel[joints + 1], qvel[joints + 2])
            for axis in range(joints, joints + 3):
                qfrc_applied[axis] = factor * qvel[axis]
        mj_step2(model, data)
        count += note_presses(step + 1, contacts, sensordata, pressing, surfaces, changes, 1 + count * (surfaces + 1))
        reached = step + 1
        if reached == due:
            due += stride
            sample = write_sample(qpos, qvel, qfrc_applied, order, joints, bodies, samples, sample)
            state = copy(qpos, joints + 7 * bodies, states, state)
            for field in (qvel, qacc_warmstart, qfrc_constraint, qfrc_applied):
                state = copy(field, joints + 6 * bodies, states, state)
            was_above, is_above = is_above, qpos[joints + 2] >= plane_m
            if was_above and not is_above:
                break
    changes[0] = count
    return reached


def note_presses(
    step: int, contacts: int, sensordata: Floats, pressing: Words, surfaces: int, changes: Words, at: int
) -> int:
    """Bring `pressing` up to date; if it changes, write the step and all of it from number `at` on, and return 1."""
    has_changed = 0
    changes[at] = step
    for surface in range(surfaces):
        presses = 1 if contacts and sensordata[_PRESS * surface] > 0.0 else 0
        if presses != pressing[surface]:
            has_changed = 1
        changes[at + 1 + surface] = pressing[surface] = presses
    return has_changed


def find_gap(
    x: float, y: float, z: float, xipos: Floats, ximat: Floats, boxes: Floats, roots: Ints, watched: int
) -> float:
    """Find the least distance from a point to the ground and to the boxes around the shapes of bodies [m]."""
    least = z * z if z > 0.0 else 0.0
    for body in range(1, watched):
        box = 6 * roots[body]
        if box >= 0:
            at, turned, square = 3 * body, 9 * body, 0.0
            a, b, c = x - xipos[at], y - xipos[at + 1], z - xipos[at + 2]
            for axis in range(3):
                along = a * ximat[turned + axis] + b * ximat[turned + 3 + axis] + c * ximat[turned + 6 + axis]
                outside = abs(along - boxes[box + axis]) - boxes[box + 3 + axis]
                square += outside * outside if outside > 0.0 else 0.0
            least = square if square < least else least
    return math.sqrt(least)


def aim_contacts(
    data_ints: Ints, data_words: Words, arena: Floats, arena_ints: Ints, origin: int, bounces: Floats, hz: float
) -> None:
    """Set the targets of all contacts, between ``mj_step1`` and ``mj_step2``, as Bullet has them.

    MuJoCo computes the acceleration that a contact asks for from the velocities at the beginning of a step, and ignores
    that the surfaces turn. A tool that swings turns so fast that a ball, which it holds with less and less force, would
    begin to hop long before it leaves. So each contact gets the velocity that it should have after the step.

    - Surfaces with a gap may close it in this step, but not penetrate each other.
    - Surfaces that penetrate each other separate slowly.
    - Surfaces that would meet in this step and bounce separate at once.
    """
    contact = (data_words[CONTACT] - origin) // 4
    gaps, speeds = (data_words[EFC_POS] - origin) // 8, (data_words[EFC_VEL] - origin) // 8
    targets = (data_words[EFC_AREF] - origin) // 8
    for _ in range(data_ints[NCON]):
        row = arena_ints[contact + EFC_ADDRESS]
        # Contacts of shapes that merely touch have no rows.
        if row >= 0:
            away, speed = arena[gaps + row] * hz, arena[speeds + row]
            bounce = bounces[arena_ints[contact + GEOM]] * bounces[arena_ints[contact + GEOM + 1]]
            wanted = away if away > 0.0 else _CORRECTED * away
            if bounce and speed < -_LEAST_BOUNCE_MPS and speed + away < 0.0:
                wanted = bounce * speed
            # Surfaces part at positive speeds. As the solver reaches the share `HARDNESS` of this acceleration, the
            # speed after the step is about `-wanted`.
            arena[targets + row] = (wanted + speed) * (-hz / HARDNESS)
        contact += CONTACT_SIZE


def write_sample(
    qpos: Floats, qvel: Floats, qfrc_applied: Floats, order: Words, joints: int, bodies: int, samples: Floats, at: int
) -> int:
    """Write a sample from number `at` on, and return the number behind it."""
    for joint in range(joints):
        place = order[joint]
        samples[at + joint], samples[at + joints + joint] = qpos[place], qvel[place]
        samples[at + 2 * joints + joint] = qfrc_applied[place]
    at += 3 * joints
    for number in range(1, bodies + 1):
        # The object is the first body in the model, and the last one in a sample.
        body = number if number < bodies else 0
        here, moves = joints + 7 * body, joints + 6 * body
        w, x, y, z = qpos[here + 3], qpos[here + 4], qpos[here + 5], qpos[here + 6]
        spin = turn(x, y, z, w, qvel[moves + 3], qvel[moves + 4], qvel[moves + 5])
        for axis in range(3):
            samples[at + axis], samples[at + 7 + axis] = qpos[here + axis], qvel[moves + axis]
            samples[at + 10 + axis] = spin[axis]
        samples[at + 3], samples[at + 4], samples[at + 5], samples[at + 6] = x, y, z, w
        at += 13
    return at


def copy(field: Floats, count: int, states: Floats, at: int) -> int:
    """Write the first numbers of a field from number `at` on, and return the number behind them."""
    for number in range(count):
        states[at + number] = field[number]
    return at + count


def turn(x: float, y: float, z: float, w: float, a: float, b: float, c: float) -> tuple[float, float, float]:
    """Turn the vector a, b, c by a unit quaternion."""
    # With t = 2 u x v for the vector part u and the real part w, the turned vector is v + w t + u x t.
    p, q, r = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p


def measure_length(x: float, y: float, z: float) -> float:
    """Measure a vector as Python's `math.hypot` does, to the same bits, which compiled functions cannot call."""
    total, lost = 0.0, 0.0
    for side in (x, y, z):
        square, error = square_exactly(side)
        before, total = total, total + square
        lost += before - total + square if before > square else square - total + before
        lost += error
    length = math.sqrt(total + lost)
    square, error = square_exactly(length)
    return length + (total - square + (lost - error)) / (2.0 * length) if length else length


def square_exactly(side: float) -> tuple[float, float]:
    """Square a number; return the square, and what rounding took from it."""
    high = side * _SPLIT - (side * _SPLIT - side)
    low = side - high
    square = side * side
    return square, high * high - square + 2.0 * high * low + low * low
