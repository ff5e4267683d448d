"""Bullet, by pybullet: rigid bodies with contacts, the engine that collections are simulated with by default."""

import throwcollect.engines.bullet.silence  # noqa: F401 - before any other module of this room imports Bullet
