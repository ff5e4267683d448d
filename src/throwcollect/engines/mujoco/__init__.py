"""MuJoCo: rigid bodies with contacts, faster than Bullet, and on Pythons that Bullet has no wheel for."""

import throwcollect.engines.mujoco.silence  # noqa: F401 - first, before another module of this room makes a world
