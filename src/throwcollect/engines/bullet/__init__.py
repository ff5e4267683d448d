"""Bullet, by pybullet: rigid bodies with contacts, the default engine."""

import throwcollect.engines.bullet.silence  # noqa: F401 - first, before another module of this room imports Bullet
