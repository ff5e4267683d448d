"""Tells a ball that the tool threw from one that left the tool by its own weight."""

from __future__ import annotations

import math
import operator

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.reproducible_math import add_up
from throwcollect.robots.tool_motion import ToolMotion
from throwcollect.tasks.measures import ObjectState
from throwcollect.tools.tool import tool_of
from throwcollect.units import NS_PER_S

_LEAST_SHARE = 0.25
"""Least speed of a throwing spoon, over the speed of a fall through the depth of its cup [-]: 0.20 m/s by default.

A ball leaves a still spoon by its weight alone with 0.41 m/s at least (0.52 of that fall); so below this threshold, the
ball owes more of its speed to its weight than to the spoon. Of 143 balls that landed after simulated motions from
random postures that hold the ball, 43 had left at a share below 0.03, most of them after the arm had come to rest; the
shares of the others spread evenly above that. Sampled throws of the product's own configurations are above 0.9.

The energy that the ball gains is no criterion: it was up to 4.3 J/kg when a still spoon lost the ball after lifting it,
and as low as -2.1 J/kg when the ball was thrown with 1.8 m/s in a downward swing.
"""


def find_early_loss(samples: Samples, header: EpisodeHeader, *, config: Config) -> str | None:
    """Explain why a trial began without a ball in the tool; None if the ball was in the tool.

    A ball that does not press on the tool at the start may be bouncing a little: it counts as in the tool if it is no
    farther than the rim's radius from the place where it would rest, and touches the tool later.
    """
    held = [contact.start_ns for contact in header.contacts if contact.body == config.tool.name]
    if held and min(held) > header.start_ns:
        seat = ToolMotion(config).place(samples.position[0])
        if math.dist(samples.object_position[0], seat) > tool_of(config).rim_radius_m:
            held = []
    if held:
        return None
    return (
        f"the ball had left the {config.tool.name} before the start, in the sim.settle_s = {config.sim.settle_s} s for "
        "settling"
    )


def explain_drop(samples: Samples, header: EpisodeHeader, release: ObjectState, *, config: Config) -> str | None:
    """Explain why a ball that left the tool was not thrown by it; None if it was thrown.

    The tool threw the ball if the tool moved in the direction that the ball then took, at a quarter or more of the
    speed of a fall through the depth of the cup. When the tool brakes, the ball still has to roll over the rim. So the
    highest speed counts that the tool had while the ball, at its own speed, covered the radius of the rim.
    """
    speed, cup = math.hypot(*release.velocity), tool_of(config)
    direction = [part / (speed or 1.0) for part in release.velocity]
    least = _LEAST_SHARE * math.sqrt(2 * config.scene.gravity_mps2 * cup.depth_m)
    release_ns = header.start_ns + round(release.time_s * NS_PER_S)
    since_ns = release_ns - (cup.rim_radius_m / speed * NS_PER_S if speed else math.inf)
    last = min(int(np.searchsorted(samples.stamps_ns, release_ns)), len(samples) - 1)
    tool = ToolMotion(config)
    fastest = -math.inf
    # The search goes backwards, because the last samples before the release are enough to recognise most throws.
    for row in range(last, -1, -1):
        velocity = tool.velocity(samples.position[row], samples.velocity[row]).tolist()
        fastest = max(fastest, add_up(map(operator.mul, direction, velocity)))
        if fastest >= least:
            return None
        if samples.stamps_ns[row] <= since_ns:
            break
    moved = math.dist(tool.place(samples.position[last]), tool.place(samples.position[0]))
    height = release.position[2] - samples.object_position[0, 2]
    work = config.scene.gravity_mps2 * height + (speed**2 - math.hypot(*samples.object_linear_velocity[0]) ** 2) / 2
    name = config.tool.name
    return (
        f"the {name} did not throw the ball: it left at {release.time_s:.3f} s with {speed:.2f} m/s, and the {name} "
        f"went that way at {fastest:z.2f} m/s, not {least:.2f} m/s; until then, the {name} had moved by "
        f"{moved * 1000:.1f} mm and done {work:z.2f} J/kg of work on the ball"
    )
