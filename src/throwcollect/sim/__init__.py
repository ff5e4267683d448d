"""The simulation: a physics world, its controllers and the ROS 2 node around them."""

import throwcollect.sim.silence  # noqa: F401 - before any other module of this room imports Bullet
