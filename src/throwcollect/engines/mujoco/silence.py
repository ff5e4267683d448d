"""Keeps MuJoCo from writing a file ``MUJOCO_LOG.TXT`` into the current directory when a world diverges."""

import mujoco


def _keep_silent(message: str) -> None:
    """Ignore the message: a world that diverges has samples that are not finite, and these are refused."""


if mujoco.get_mju_user_warning() is None:
    mujoco.set_mju_user_warning(_keep_silent)
