"""A controller of three joints, a plant and a clock for the acceptance cases."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from throwcollect.control.controller import JointTrajectoryController
from throwcollect.control.parameters import Constraints, ControllerParameters, JointConstraints
from throwcollect.control.values import (
    ErrorCode,
    GoalResult,
    GoalStatus,
    JointState,
    JointTolerance,
    Trajectory,
    TrajectoryGoal,
    TrajectoryPoint,
    TrajectoryRefusal,
)

JOINTS = ("j1", "j2", "j3")
START = (1.1, 2.1, 3.1)
PERIOD_NS = 10_000_000
SHIPPED = ControllerParameters(JOINTS)


def constrain(goal: float = 0.0, goal_time: float = 0.0, trajectory: float = 0.0) -> ControllerParameters:
    limits = {joint: JointConstraints(trajectory=trajectory, goal=goal) for joint in JOINTS}
    constraints = Constraints(goal_time=goal_time, joints=limits)
    return ControllerParameters(JOINTS, constraints=constraints)


TALOS = constrain(goal=0.02, goal_time=0.6)


def seconds(value: float) -> int:
    return round(value * 1e9)


def point(time_s: float, positions: Sequence[float], velocities=(), accelerations=(), effort=()) -> TrajectoryPoint:
    return TrajectoryPoint(seconds(time_s), positions, velocities, accelerations, effort)


def to(time_s: float, j1: float, degree: int = 1) -> TrajectoryPoint:
    """A point for joint 1, at rest if the degree has velocities or accelerations; the other joints stay."""
    still = (0.0, 0.0, 0.0)
    return point(time_s, (j1, *START[1:]), still if degree > 1 else (), still if degree > 3 else ())


def through(points: Sequence[TrajectoryPoint], names=JOINTS, stamp_ns: int | None = None) -> Trajectory:
    """The trajectory through these points."""
    rows = [(p.time_from_start_ns, p.positions, p.velocities, p.accelerations, p.effort) for p in points]
    times_ns, positions, velocities, accelerations, effort = zip(*rows, strict=True) if rows else ((),) * 5
    return Trajectory(names, times_ns, positions, velocities, accelerations, effort, stamp_ns)


def goal(*points: TrajectoryPoint, names=JOINTS, stamp_s: float | None = None, **tolerances) -> TrajectoryGoal:
    stamp_ns = None if stamp_s is None else seconds(stamp_s)
    for key in ("path_tolerance", "goal_tolerance"):
        if key in tolerances:
            tolerances[key] = [JointTolerance(*tolerances[key])]
    return TrajectoryGoal(through(points, names, stamp_ns), **tolerances)


@dataclass
class Plant:
    """Joints that follow their command: ideally, not at all, with an offset, or with a first-order lag.

    The bulk test runs two side by side, so a plant is a pure function of its commands.
    """

    kind: str = "ideal"
    position: np.ndarray = field(default_factory=lambda: np.array(START))
    velocity: float | Sequence[float] = 0.0
    lag_s: float = 0.1
    measures_velocity: bool = False

    def apply(self, command: np.ndarray) -> None:
        if self.kind == "ideal":
            self.position = np.array(command)
        elif self.kind == "offset":
            self.position = command - 0.3
        elif self.kind == "lag":
            share = 1 - math.exp(-PERIOD_NS / 1e9 / self.lag_s)
            self.position = self.position + share * (command - self.position)

    def measure(self) -> JointState:
        if not self.measures_velocity:
            return JointState(self.position)
        return JointState(self.position, np.broadcast_to(self.velocity, self.position.shape))


class Bench:
    """Drives a controller step by step; `k` counts the updates since the last goal."""

    def __init__(
        self,
        parameters: ControllerParameters = SHIPPED,
        plant: Plant | None = None,
        now_s=1000.0,
        **deviations: bool,
    ) -> None:
        self.plant = dataclasses.replace(plant or Plant(), measures_velocity=parameters.measures_velocity)
        self.controller = JointTrajectoryController("c", parameters, period_ns=PERIOD_NS, **deviations)
        self.now_ns = seconds(now_s)
        self.controller.reset(self.now_ns, self.plant.measure())
        self.k = 0
        self.commands: dict[int, np.ndarray] = {}
        self.results: list[tuple[int, GoalResult]] = []

    def send(self, request: TrajectoryGoal, goal_id="A") -> TrajectoryRefusal | None:
        refusal = self.controller.submit(goal_id, request, self.now_ns)
        self.collect()
        if refusal is None:
            self.k = 0
        return refusal

    def collect(self) -> None:
        self.results += [(self.k, result) for result in self.controller.pop_results()]

    def step(self, updates: int = 1) -> None:
        for _ in range(updates):
            self.k += 1
            self.now_ns += PERIOD_NS
            command = self.controller.update(self.now_ns, self.plant.measure())
            self.commands[self.k] = np.array(command)
            self.plant.apply(command)
            self.collect()


REACHED = (GoalStatus.SUCCEEDED, ErrorCode.SUCCESSFUL, "Goal successfully reached!")

PREEMPTED = (GoalStatus.ABORTED, ErrorCode.INVALID_GOAL, "Current goal preempted by new incoming action.")

CANCELED = (GoalStatus.CANCELED, ErrorCode.SUCCESSFUL, "")

OFF_PATH = "Aborted due to path tolerance violation"

TOO_LATE = "Aborted due to goal_time_tolerance exceeding by "

PARTIAL = dataclasses.replace(SHIPPED, allow_partial_joints_goal=True)

INTEGRATING = dataclasses.replace(
    SHIPPED, allow_integration_in_goal_trajectories=True, allow_nonzero_velocity_at_trajectory_end=True
)

MOVING_END = dataclasses.replace(SHIPPED, allow_nonzero_velocity_at_trajectory_end=True)

ZERO = (0.0, 0.0, 0.0)

ONE_POINT = (point(1.0, (2.1, 2.1, 3.1)),)


def last_velocity(value: float) -> TrajectoryGoal:
    return goal(point(1.0, START, (0, value, 0)))


def braking(deceleration: float, *, trajectory: float = 0.0) -> ControllerParameters:
    limits = dict.fromkeys(JOINTS, JointConstraints(trajectory, 0.0, deceleration))
    return dataclasses.replace(SHIPPED, constraints=Constraints(decelerate_on_cancel=True, joints=limits))


FROZEN, OFFSET, LAG = Plant("frozen"), Plant("offset"), Plant("lag")
