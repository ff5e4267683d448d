"""What contacts ask for, in the way of Bullet.

MuJoCo has contacts ask for accelerations, by the velocities at the begin of a step, and does not see that surfaces
turn. A tool that swings turns so fast that a ball, which is held in it by less and less force, would begin to hop long
before it leaves. So each contact is told in each step what velocity there should be after it.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

_ROWS = 3
"""Rows of a contact with friction, but without friction of rolling and turning on the spot."""

HARDNESS = 0.9
"""Share of the acceleration that a contact asks for which it gets; the harder, the longer it is solved."""

_CORRECTED = 0.2
"""Share of a penetration that one step removes; Bullet's share."""

_LEAST_BOUNCE_MPS = 0.2
"""What comes more slowly does not bounce; as in Bullet."""


def aim_contacts(data: mujoco.MjData, hz: float, restitutions: NDArray[np.float64] | None) -> None:
    """Have all contacts ask for what is right after a step: between ``mj_step1`` and ``mj_step2``.

    - Surfaces that are apart may come as near as they are apart, but not nearer.
    - Those that are in one another part slowly.
    - Those that would meet in this step and bounce part at once.

    Args:
        data: The world; it has a contact.
        hz: Steps per second.
        restitutions: Of each shape of the model; of a contact, it is the product of both. None if nothing bounces.
    """
    # Rows of contacts are the last ones, and each has three: along its normal, and two of friction. Contacts of shapes
    # that merely touch have none.
    first = data.ne + data.nf + data.nl
    away, speeds = data.efc_pos[first::_ROWS] * hz, data.efc_vel[first::_ROWS]
    wanted = np.maximum(away, _CORRECTED * away)
    if restitutions is not None:
        bounces = (speeds < -_LEAST_BOUNCE_MPS) & (speeds + away < 0.0)
        wanted[bounces] = (restitutions[data.contact.geom[data.efc_id[first::_ROWS]]].prod(axis=1) * speeds)[bounces]
    wanted += speeds
    wanted *= -hz / HARDNESS
    data.efc_aref[first::_ROWS] = wanted
