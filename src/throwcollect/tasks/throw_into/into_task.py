"""The task of throwing into a bin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.robots.surroundings import object_of
from throwcollect.tasks.result_columns import ObjectState
from throwcollect.tasks.task import Failure
from throwcollect.tasks.throw.flight import Flight
from throwcollect.tasks.throw.throw_result import ThrowResult
from throwcollect.tasks.throw.throw_task import ThrowTask
from throwcollect.tasks.throw_into.into_config import ThrowIntoConfig
from throwcollect.tasks.throw_into.into_result import IntoOutcome, IntoResult

_WALL = "wall"
_BIN = "bin_"
"""Beginning of the names of the parts of the bin."""


class ThrowIntoTask(ThrowTask):
    """A throw after which the ball should rest in a bin.

    Release, apex and landing are those of a throw whose landing plane is at the height of the rim; the landing is
    measured only if the ball has touched nothing before. After the failures of a throw, up to ``self_hit`` and
    ``recaught``, come these outcomes; the first one that holds counts:

    1. ``in_bin``: the trial ended as the ball had come to rest in the bin. On a mark without walls: it landed there.
    2. ``wall_hit``, ``rim_hit`` or ``body_hit``: what the ball touched first, before it came down to the rim.
    3. ``bounced_out``: it came down in the opening.
    4. ``short`` or ``beyond``, as seen from the release in the direction of the middle of the bin.
    5. ``timeout``: it neither rested nor came down to the rim and the ground.
    """

    outcomes = IntoOutcome
    results = IntoResult
    reasons = "Why the ball did not simply stay in the bin; null if it did."

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        task = cast("ThrowIntoConfig", config.task)
        self._bin, self._wall = task.bin, task.wall

    @property
    def landing_height_m(self) -> float:
        """Height of the rim [m]."""
        return self._bin.rim_height_m

    def measure_flight(self, result: ThrowResult, flight: Flight) -> ThrowResult:
        """Measure the flight; see `ThrowTask.measure_flight`."""
        result = super().measure_flight(result, flight)
        miss_m = clearance_m = None
        if (landing := result.landing) is not None:
            miss_m = math.hypot(*self._bin.to_own_axes(landing.position[0], landing.position[1]))
        if self._wall is not None:
            passed = np.flatnonzero(np.diff(np.sign(flight.positions[:, 0] - self._wall.x_m)))
            if len(passed):
                # Between two samples, the ball moves by millimetres along a line that is nearly straight.
                one, other = flight.positions[passed[0] : passed[0] + 2].tolist()
                share = (self._wall.x_m - one[0]) / (other[0] - one[0])
                height = one[2] + share * (other[2] - one[2])
                clearance_m = height - object_of(self.config).radius_m - self._wall.height_m
        return replace(result, bin_miss_m=miss_m, wall_clearance_m=clearance_m)  # type: ignore[call-arg]

    def judge_flight(
        self, result: ThrowResult, samples: Samples, header: EpisodeHeader, impacts: Sequence[Contact]
    ) -> tuple[ThrowResult, Failure | None]:
        """Find where the ball ended; see `ThrowTask.judge_flight`."""
        rest = self.final_state(samples, header) if header.end_reason == "rest" else None
        result = replace(result, rest=rest, bounces=len(impacts))  # type: ignore[call-arg]
        return result, self._find_miss(result, rest, impacts, header)

    def _find_miss(
        self, result: ThrowResult, rest: ObjectState | None, impacts: Sequence[Contact], header: EpisodeHeader
    ) -> Failure | None:
        landing = result.landing
        ended = rest if self._bin.depth_m else landing
        if ended is not None and self._bin.holds(ended.position, object_of(self.config).radius_m):
            return None
        if landing is None and impacts:
            first = impacts[0]
            at = f"the ball touched {first.body} at {header.seconds_at(first.start_ns):.3f} s"
            kind = IntoOutcome.BODY_HIT
            if first.body == _WALL:
                kind = IntoOutcome.WALL_HIT
            elif first.body.startswith(_BIN):
                kind = IntoOutcome.RIM_HIT
            return Failure(kind, at)
        if landing is None or result.release is None:
            return Failure(IntoOutcome.TIMEOUT, f"the ball did not come down; the trial ended as {header.end_reason}")
        x, y, _ = landing.position
        if self._bin.depth_m and self._bin.is_over(x, y):
            if header.end_reason == "timeout":
                return Failure(IntoOutcome.TIMEOUT, "the ball had not come to rest in the bin")
            return Failure(
                IntoOutcome.BOUNCED_OUT, f"the ball came into the bin at {landing.time_s:.3f} s, and left it"
            )
        start_x, start_y, _ = result.release.position
        way_x, way_y = self._bin.x_m - start_x, self._bin.y_m - start_y
        further = (x - self._bin.x_m) * way_x + (y - self._bin.y_m) * way_y
        kind = IntoOutcome.SHORT if further < 0 else IntoOutcome.BEYOND
        return Failure(kind, f"the ball came down to the rim at x {x:.3f} m, y {y:.3f} m")
