"""The task of pushing a puck along a table: finds outcome and measures from its recorded samples and contacts."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import cast

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.episode.record import EndReason, EpisodeHeader, Samples
from throwcollect.tasks.result_columns import ObjectState
from throwcollect.tasks.slide.slide_config import SlideConfig
from throwcollect.tasks.slide.slide_result import SlideOutcome, SlideResult
from throwcollect.tasks.task import HEIGHT, EndRule, Failure, Task
from throwcollect.units import NS_PER_S


class SlideTask(Task[SlideResult]):
    """The arm swings from start to end, and the tool pushes the puck, which slides until friction stops it.

    Between ``tracking_failed`` and ``limit_violated`` (see `Task.judge`) come these outcomes; the first one that holds
    counts. Everything that can be measured is measured in any case. The puck may touch bodies of the scene.

    1. ``robot_hit``: the puck touched a link of the robot.
    2. ``missed_puck``: the tool never touched it.
    3. ``pushed_twice``: the tool touched it again after at least `task.push_gap_s` without contact.
    4. ``off_table``: its centre went below the table's upper face, which ends the trial.
    5. ``timeout``: puck and arm did not come to rest.

    Positions and velocities at the first touch and when the puck leaves are interpolated linearly between samples.
    """

    outcomes = SlideOutcome
    results = SlideResult
    reasons = "Why the puck did not simply come to rest; null if it did."
    report = "throwcollect.publish.report.slide.slide_sections:report_slides"

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self._task = cast("SlideConfig", config.task)

    @property
    def end_height_m(self) -> float:
        """Height of the table's upper face [m]; see `Task.end_height_m`."""
        return self._task.table.height_m

    def end_rule(self) -> EndRule:
        """Make the rule by which a trial ends when the puck has left the table; see `Task.end_rule`."""
        top_m = self.end_height_m

        def has_fallen(before: Sequence[float], now: Sequence[float], touching: Collection[str]) -> EndReason | None:  # noqa: ARG001
            return "landed" if now[HEIGHT] < top_m else None

        return has_fallen

    def assess(
        self, result: SlideResult, samples: Samples, header: EpisodeHeader
    ) -> tuple[SlideResult, Failure | None]:
        """Measure the slide, and find what kept the puck from a rest after one push; see `Task.assess`."""
        touches = [each for each in header.contacts if each.body == self.config.tool.name]
        rest = None if header.end_reason != "rest" else self.final_state(samples, header)
        hit = leave = yaw = distance = None
        if touches:
            hit = _interpolate(samples, header, touches[0].start_ns)
            if (end_ns := touches[-1].end_ns) is not None:
                leave = _interpolate(samples, header, end_ns)
        if rest is not None:
            x, y, z, w = samples.object_orientation_xyzw[-1].tolist()
            yaw = math.atan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))
            if leave is not None:
                distance = math.dist(leave.position[:2], rest.position[:2])
        gap_ns = self._task.push_gap_s * NS_PER_S
        gaps = [one.end_ns is not None and other.start_ns - one.end_ns >= gap_ns for one, other in pairwise(touches)]
        result = replace(
            result,
            hit=hit,
            leave=leave,
            rest=rest,
            rest_yaw_rad=yaw,
            puck_speed_mps=None if leave is None else math.hypot(*leave.velocity[:2]),
            slide_distance_m=distance,
            pushes=sum(gaps) + bool(touches),
        )
        return result, self._find_failure(result, header)

    def _find_failure(self, result: SlideResult, header: EpisodeHeader) -> Failure | None:
        links = [each for each in header.contacts if each.body != self.config.tool.name and not self.stands(each.body)]
        if links:
            at = f"the puck touched {links[0].body} at {header.seconds_at(links[0].start_ns):.3f} s"
            return Failure(SlideOutcome.ROBOT_HIT, at)
        tool = self.config.tool.name
        if not result.pushes:
            return Failure(SlideOutcome.MISSED_PUCK, f"the {tool} never touched the puck")
        if result.pushes > 1:
            return Failure(SlideOutcome.PUSHED_TWICE, f"the {tool} pushed the puck {result.pushes} times")
        if header.end_reason == "landed":
            return Failure(SlideOutcome.OFF_TABLE, "the puck fell from the table")
        if result.rest is None:
            return Failure(SlideOutcome.TIMEOUT, "the puck or the arm had not come to rest")
        return None


def _interpolate(samples: Samples, header: EpisodeHeader, instant_ns: int) -> ObjectState:
    """Find the state of the object between two samples."""
    columns = np.hstack([samples.object_position, samples.object_linear_velocity]).T
    x, y, z, vx, vy, vz = (float(np.interp(instant_ns, samples.stamps_ns, column)) for column in columns)
    return ObjectState(header.seconds_at(instant_ns), (x, y, z), (vx, vy, vz))
