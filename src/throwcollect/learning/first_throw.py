"""Searches a first throw of a robot: a posture that holds the ball, a motion that lands it, and ranges to sweep."""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.robot_config import RobotConfig
from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.plan.trials import Trial
from throwcollect.robots.derived import Postures
from throwcollect.robots.feasibility import Feasibility
from throwcollect.robots.robot import Robot, joint_limits
from throwcollect.sim.simulator import Simulator
from throwcollect.tasks.starter import Beginning
from throwcollect.tasks.task import trajectory_of
from throwcollect.wording import blank_numbers, format_count

_STARTS = 40
_MOTIONS = 150
"""Motions that are drawn for each start posture."""
_MOST_MOVING = 3
_LEAST_RAD, _MOST_RAD = 0.3, 1.6
_SHORTEST_S = 0.35
_PEAK = 2.2
"""Duration of a motion times the speed limit over the angle: a minimum-jerk motion peaks at 1.875 times its mean."""
_RELEASE = 0.6, 0.62
"""Share of the motion at which the ball leaves, about."""
_SPOON_M = 0.3
"""Distance of the ball from the hand."""
_MARGIN_RAD = 0.05
_WIDEST_RAD, _NARROWEST_RAD = 0.2, 0.05
_SLOWER = 1.3
_GRID = 6, 4
"""Trials along each range, by which the share that lands is estimated."""
_LEAST_SHARE = 0.94
_SEED = 1
_PATIENCE_S = 50.0
"""Time after which the search goes on with what has landed."""
_ENOUGH = 12
"""Throws that land, after which the fastest ones are looked at more closely."""


@dataclass(frozen=True)
class _Candidate:
    speed: float
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    duration_s: float


class FirstThrowSearch:
    """Searches a throw of a robot that lands, and ranges in which nearly all throws land.

    Args:
        robot: The complete section of the robot.
        lines: What a configuration has of it.
        task: Name of the task.
        engine: Name of the physics engine.
        say: A callback that gets progress, a line at a time.
    """

    def __init__(
        self, robot: RobotConfig, lines: Sequence[str], task: str, engine: str, say: Callable[[str], None]
    ) -> None:
        self._robot: Robot = robot.find()
        self._lines, self._say = lines, say
        self._keys = {"robot": robot, "sim": {"engine": engine}}
        self._task = task
        self._tried: Counter[str] = Counter()
        self._random = np.random.default_rng(_SEED)
        self._postures = Postures(self._robot)
        self._joints = list(self._postures.model.names)[1:]
        limits = joint_limits(self._robot)
        order = [self._robot.joints.index(joint) for joint in self._joints]
        self._velocity = limits.velocity[order]
        lower = np.maximum(limits.lower[order], -2 * math.pi)
        upper = np.minimum(limits.upper[order], 2 * math.pi)
        margin = np.minimum(_MARGIN_RAD, (upper - lower) / 20)
        self._lower, self._upper = lower + margin, upper - margin
        self._carrying = [index for index in self._postures.carrying if self._velocity[index] > 0]
        self._base_m = robot.base_height_m

    def run(self) -> Beginning:
        """Search; the result is what a configuration begins with."""
        begin = time.monotonic()
        starts, angle = self._postures.find_upright(_STARTS)
        if not starts:
            raise ConfigError(
                f"{self._robot.title}: no posture holds the tool upright and is clear: "
                f"the best angle found is {math.degrees(angle):.0f}°",
                hint="turn the hand by robot.tool_pose",
            )
        candidates = sorted(
            (each for start in starts for each in self._draw_motions(start)), key=lambda each: -each.speed
        )
        if not candidates:
            raise ConfigError(f"{self._robot.title}: no joint that carries the hand can move by {_LEAST_RAD:g} rad")
        self._say(f"{format_count(len(starts), 'posture')} hold the ball; tries {len(candidates)} motions")
        config = self._make_config(candidates[0].start, candidates[0].end, 1.0, self._carrying)
        landed: list[tuple[float, _Candidate]] = []
        said = time.monotonic()
        with closing(Simulator(config)) as simulator:
            feasibility = Feasibility(config)
            for number, candidate in enumerate(candidates):
                # Joints that do not carry the tool rest where the first candidate has them.
                distance = self._throw(self._list_values(candidate), feasibility, simulator)
                if distance is not None:
                    landed.append((distance, candidate))
                if len(landed) >= _ENOUGH or (waited := time.monotonic() - begin) > _PATIENCE_S:
                    break
                if time.monotonic() - said > 2:
                    said = time.monotonic()
                    self._say(f"{number + 1} motions tried in {waited:.0f} s, {len(landed)} landed")
        for distance, candidate in landed:
            if (found := self._spread(candidate, distance)) is not None:
                return found
        reasons = "; ".join(f"{count} times {reason}" for reason, count in self._tried.most_common(5))
        raise ConfigError(
            f"{self._robot.title}: found no throw that lands: {reasons or 'no motion was fast enough'}",
            hint="give the robot another robot.tool_pose or robot.base_height_m",
        )

    def _draw_motions(self, start: NDArray[np.float64]) -> Iterator[_Candidate]:
        """Draw motions from a posture, with a rough speed of the ball at its release [m/s]."""
        begin = np.clip(start, self._lower, self._upper)
        for _ in range(_MOTIONS if self._carrying else 0):
            count = int(self._random.integers(1, min(_MOST_MOVING, len(self._carrying)) + 1))
            moving = self._random.choice(self._carrying, size=count, replace=False)
            end = begin.copy()
            stroke = self._random.uniform(-_MOST_RAD, _MOST_RAD, count)
            end[moving] = np.clip(begin[moving] + stroke, self._lower[moving], self._upper[moving])
            far = np.abs(end - begin)
            if far.max() < _LEAST_RAD:
                continue
            duration_s = max(_SHORTEST_S, float((_PEAK * far / self._velocity).max()))
            early, late = (self._find_ball(begin + share * (end - begin)) for share in _RELEASE)
            velocity = (late - early) / (_RELEASE[1] - _RELEASE[0]) * 1.9 / duration_s
            # A ball that goes down at its release is not thrown.
            if velocity[2] > -0.5 and early[2] + self._base_m > 0:
                yield _Candidate(float(np.hypot(*velocity[:2]) + velocity[2] / 2), begin, end, round(duration_s, 3))

    def _find_ball(self, posture: NDArray[np.float64]) -> NDArray[np.float64]:
        place: NDArray[np.float64] = self._postures.place_tool(posture).act(np.array([0.0, 0.0, -_SPOON_M]))
        return place

    def _make_config(
        self, start: NDArray[np.float64], end: NDArray[np.float64], duration_s: float, moving: list[int]
    ) -> Config:
        angles = self._name(start)
        ends = self._name(end)
        task = {
            "name": self._task,
            "start": {joint: angles[joint] for joint in self._robot.joints},
            "end": {self._joints[index]: ends[self._joints[index]] for index in sorted(moving)},
            "duration_s": duration_s,
        }
        return Config.model_validate({**self._keys, "task": task})

    def _name(self, posture: NDArray[np.float64]) -> dict[str, float]:
        return dict(zip(self._joints, np.round(posture, 4).tolist(), strict=True))

    def _list_values(self, candidate: _Candidate) -> dict[str, float]:
        start, end = self._name(candidate.start), self._name(candidate.end)
        names = [self._joints[index] for index in self._carrying]
        values = {f"task.start.{joint}": start[joint] for joint in names}
        return values | {f"task.end.{joint}": end[joint] for joint in names} | {"task.duration_s": candidate.duration_s}

    def _throw(self, values: Mapping[str, float], feasibility: Feasibility, simulator: Simulator) -> float | None:
        """Try a motion; return how far it throws [m] if the throw lands."""
        try:
            trial = with_values(simulator.config, values)
            if (reason := feasibility.check(trial, trajectory_of(trial))) is not None:
                self._tried[f"refused: {blank_numbers(reason)}"] += 1
                return None
            episode = simulator.run(Trial(0, dict(values), 0, ""))
        except ThrowcollectError as error:
            self._tried[blank_numbers(str(error))] += 1
            return None
        result = json.loads(episode.result)
        self._tried[str(result["outcome"])] += 1
        if result["outcome"] != trial.task.success:
            return None
        return math.hypot(float(result["landing_x_m"]), float(result["landing_y_m"]))

    def _spread(self, candidate: _Candidate, distance: float) -> Beginning | None:
        """Find ranges about a throw in which nearly all trials land; None if there are none."""
        moving = [index for index in self._carrying if abs(candidate.end[index] - candidate.start[index]) > 1e-4]
        config = self._make_config(candidate.start, candidate.end, candidate.duration_s, moving)
        widest = max(moving, key=lambda index: abs(candidate.end[index] - candidate.start[index]))
        joint, centre = self._joints[widest], float(candidate.end[widest])
        half, slower = _WIDEST_RAD, _SLOWER
        with closing(Simulator(config)) as simulator:
            feasibility = Feasibility(config)
            while half >= _NARROWEST_RAD:
                low, high = max(centre - half, self._lower[widest]), min(centre + half, self._upper[widest])
                shortest = candidate.duration_s
                ranges = {
                    f"task.end.{joint}": (round(float(low), 3), round(float(high), 3)),
                    "task.duration_s": (shortest, round(slower * shortest, 3)),
                }
                axes = (np.linspace(*each, count).tolist() for each, count in zip(ranges.values(), _GRID, strict=True))
                grid = [dict(zip(ranges, point, strict=True)) for point in product(*axes)]
                share = sum(self._throw(point, feasibility, simulator) is not None for point in grid) / len(grid)
                self._say(f"{share:.0%} land with {joint} from {low:.2f} to {high:.2f} rad")
                if share >= _LEAST_SHARE:
                    self._say(f"found a throw of {distance:.2f} m; {share:.0%} of the trials about it land")
                    task = config.task
                    return Beginning(self._lines, task.start, task.end, task.duration_s, ranges)
                half, slower = half / 2, 1 + (slower - 1) / 2
        return None
