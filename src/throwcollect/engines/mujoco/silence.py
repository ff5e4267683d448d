"""Keeps MuJoCo from telling of a world that diverges in a file ``MUJOCO_LOG.TXT``, wherever a process happens to be."""

import mujoco


def _keep_silent(message: str) -> None:
    """Samples that are not finite tell it, and are refused."""


if mujoco.get_mju_user_warning() is None:
    mujoco.set_mju_user_warning(_keep_silent)
