"""Target velocities of contacts, as Bullet has them.

MuJoCo computes the acceleration that a contact asks for from the velocities at the beginning of a step, and ignores
that the surfaces turn. A tool that swings turns so fast that a ball, which it holds with less and less force, would
begin to hop long before it leaves. So this module gives each contact the velocity that it should have after the step.
"""

from __future__ import annotations

from collections.abc import Mapping

import mujoco

SLIDING_ROWS, ROLLING_ROWS = 3, 6
"""Rows of a contact: one along its normal and two of sliding friction; with rolling friction, three more."""

HARDNESS = 0.9
"""Share of its target acceleration that a contact reaches; the higher it is, the longer the solver takes."""

_CORRECTED = 0.2
"""Share of a penetration that one step removes, as in Bullet."""

_LEAST_BOUNCE_MPS = 0.2
"""Contacts with a lower approach speed do not bounce, as in Bullet."""


def aim_contacts(
    data: mujoco.MjData, hz: float, restitution: float, bounces: Mapping[int, float], rows: int = SLIDING_ROWS
) -> None:
    """Set the targets of all contacts, between ``mj_step1`` and ``mj_step2``.

    - Surfaces with a gap may close it in this step, but not penetrate each other.
    - Surfaces that penetrate each other separate slowly.
    - Surfaces that would meet in this step and bounce separate at once.

    Args:
        data: The world, with at least one contact.
        hz: Steps per second.
        restitution: Restitution of all contacts, if `bounces` is empty.
        bounces: Restitution of the shapes that have another one than 1, by their number; a contact has the product.
        rows: Rows of each contact, if `bounces` is empty.
    """
    # The last rows are those of contacts, the first of each along its normal. Contacts of shapes that merely touch have
    # no rows. There are one or two contacts, for which plain numbers take a third of the time of arrays, to the same
    # bits.
    gaps, speeds, targets = data.efc_pos.tolist(), data.efc_vel.tolist(), data.efc_aref
    contacts = dict.fromkeys(range(data.ne + data.nf + data.nl, len(gaps), rows), restitution)
    if bounces:
        pairs = zip(data.contact.efc_address.tolist(), data.contact.geom.tolist(), strict=True)
        contacts = {row: bounces.get(one, 1.0) * bounces.get(other, 1.0) for row, (one, other) in pairs if row >= 0}
    for row, bounce in contacts.items():
        away, speed = gaps[row] * hz, speeds[row]
        wanted = max(away, _CORRECTED * away)
        if bounce and speed < -_LEAST_BOUNCE_MPS and speed + away < 0.0:
            wanted = bounce * speed
        # Surfaces part at positive speeds. As the solver reaches the share `HARDNESS` of this acceleration, the speed
        # after the step is about `-wanted`.
        targets[row] = (wanted + speed) * (-hz / HARDNESS)
