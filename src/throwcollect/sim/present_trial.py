"""The trial that a simulation is set up for: its lease, and the goals of its controllers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.control.values import ErrorCode, Trajectory, TrajectoryGoal, TrajectoryRefusal
from throwcollect.errors import RequestError
from throwcollect.robots.robot import Robot
from throwcollect.robots.trajectory import JointTrajectory

NO_TRIAL = -1
"""Number of the trial while none is set up."""


class PresentTrial:
    """The trial of a simulation, without the physics.

    Attributes:
        number: Number of the trial that is set up; `NO_TRIAL` if none is.
        config: Configuration that the next reset prepares: that of the trial or, without one, what clients have set.
        motion: Motion of a trial that `Simulator.begin` has begun, until its episode is handed over; otherwise None.
    """

    def __init__(self, config: Config) -> None:
        self._configured = config
        self.set_up_nothing()

    def set_up_nothing(self) -> None:
        """End the lease, and let the next reset go back to the configuration."""
        self.motion: JointTrajectory | None = None
        self.number, self.config = NO_TRIAL, self._configured

    @property
    def leased(self) -> bool:
        """Whether the trial belongs to a coordinator; meanwhile, no other client may change anything."""
        return self.motion is not None

    def require_free(self) -> None:
        """Refuse a request that would change a leased trial."""
        if self.leased:
            raise RequestError("RESULT_INCORRECT_STATE", self.lease_in_words)

    @property
    def lease_in_words(self) -> str:
        """Sentence by which requests are refused while the simulation is leased."""
        return f"the simulation is leased for trial {self.number}, until its episode is handed over"

    @property
    def refusal(self) -> TrajectoryRefusal | None:
        """Refusal of goals and trajectories while the simulation is leased; otherwise None."""
        return TrajectoryRefusal(ErrorCode.INVALID_GOAL, self.lease_in_words) if self.leased else None


def trial_goals(robot: Robot, trajectory: JointTrajectory, posture: Mapping[str, float]) -> dict[str, TrajectoryGoal]:
    """Split a joint trajectory into one goal for each controller that moves, in the robot's order.

    Controllers refuse partial goals by default. So joints of a moving limb that do not move themselves are sent to
    where they are in `posture`, the angles of all joints at the start of the trial [rad].
    """
    moved = {robot.controller_of(joint) for joint in trajectory.joints}
    return {
        name: _make_goal(trajectory, joints, posture) for name, joints in robot.controllers.items() if name in moved
    }


def _make_goal(trajectory: JointTrajectory, joints: tuple[str, ...], posture: Mapping[str, float]) -> TrajectoryGoal:
    positions = _pick_columns(trajectory.joints, trajectory.positions, joints, [posture[joint] for joint in joints])
    still = [0.0] * len(joints)
    velocities = _pick_columns(trajectory.joints, trajectory.velocities, joints, still)
    accelerations = _pick_columns(trajectory.joints, trajectory.accelerations, joints, still)
    # Times are rounded and not cut off, because a product may lie just below the whole number that is meant.
    stamps = np.rint(trajectory.times * 1e9).astype(np.int64).tolist()
    return TrajectoryGoal(Trajectory(joints, stamps, positions, velocities, accelerations))


def _pick_columns(
    present: tuple[str, ...], values: NDArray[np.float64], wanted: tuple[str, ...], otherwise: list[float]
) -> NDArray[np.float64]:
    table = np.tile(np.array(otherwise), (len(values), 1))
    for column, joint in enumerate(wanted):
        if joint in present:
            table[:, column] = values[:, present.index(joint)]
    return table
