"""The kind of part `Task`: it plans the motion of a trial, and judges its episode."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic

import numpy as np

from throwcollect.config.motion import MinimumJerk, MotionFile
from throwcollect.config.schema import Config
from throwcollect.engines.engine import GROUND
from throwcollect.episode.record import EndReason, EpisodeHeader, Samples
from throwcollect.members import explain_failure, load_part
from throwcollect.robots.description import robot_of
from throwcollect.robots.surroundings import object_of
from throwcollect.robots.trajectory import JointTrajectory, rest_at
from throwcollect.tasks.dmp import dmp_trajectory
from throwcollect.tasks.joint_measures import explain_failed_goal, explain_violation, measure_joints
from throwcollect.tasks.minimum_jerk import minimum_jerk_trajectory
from throwcollect.tasks.motions import file_trajectory
from throwcollect.tasks.result import (
    LIMIT_VIOLATED,
    LOST,
    TRACKING_FAILED,
    AnyResult,
    Outcome,
    ResultColumns,
    with_policy,
)
from throwcollect.tasks.result_columns import ObjectState

EndRule = Callable[[Sequence[float], Sequence[float], Collection[str]], EndReason | None]
"""Gets the object in one sample and in the next one, each as the last numbers of an engine's `Sample`, and the names of
what presses on it; returns why the trial ends with the later sample, None if it goes on."""
HEIGHT = 2
"""Number of the object's height in what an `EndRule` gets."""


@dataclass(frozen=True)
class Failure:
    """Why a trial is no success.

    Attributes:
        outcome: The outcome that the trial has instead.
        reason: The reason, in one sentence.
    """

    outcome: Outcome
    reason: str


class Task(ABC, Generic[AnyResult]):
    """A task, with the configuration of one trial of it, or of a whole collection.

    A member of the family ``tasks`` is a section of the configuration (`TaskConfig`) whose `implementation` is derived
    from this class.

    Attributes:
        outcomes: All outcomes of the task.
        results: Class of the task's results, whose fields declare their columns of the table.
        reasons: Description of the column of reasons, one sentence.
        report: ``module:function``, imported when a report is made: a function that takes a `Dataset` and its
            `Outcomes` and returns a `TaskReport` with sections to add; empty if there are none.
    """

    outcomes: ClassVar[type[Outcome]]
    results: type[AnyResult]
    reasons: ClassVar[str] = "Why the trial is no simple success; null if it is."
    report: ClassVar[str] = ""

    def __init__(self, config: Config) -> None:
        self.config = config
        if config.task.policy is not None:
            self.results = with_policy(self.results)  # type: ignore[assignment, arg-type]

    @property
    def columns(self) -> ResultColumns[AnyResult]:
        """The columns of the task's results, in the table of a collection of this configuration."""
        return ResultColumns(
            self.results,
            tuple(self.config.task.end),
            tool=self.config.tool.name,
            acted_on=self.config.acted_on,
            sliding=robot_of(self.config).sliding,
        )

    def trajectory(self) -> JointTrajectory:
        """Plan the motion of a trial: by the family of `task.trajectory`, from `task.start` to `task.end`.

        Returns:
            Points over the joints of `task.end`, in the order of `Robot.joints`; the first one is at time 0 and at
            `task.start`, the last one at rest and exactly at `task.end`.

        Raises:
            ConfigError: If the family has no usable motion for these parameters, such as a DMP that does not settle, or
                a motion of a file that begins elsewhere.
        """
        task, robot = self.config.task, robot_of(self.config)
        end = {joint: task.end[joint] for joint in robot.joints if joint in task.end}
        family = task.trajectory
        if isinstance(family, MotionFile):
            return file_trajectory(task.start, end, family=family, robot=robot)
        if isinstance(family, MinimumJerk):
            return minimum_jerk_trajectory(
                task.start, end, duration_s=task.duration_s, family=family, points_hz=task.points_hz
            )
        return dmp_trajectory(task.start, end, duration_s=task.duration_s, family=family, points_hz=task.points_hz)

    def judge(self, samples: Samples, header: EpisodeHeader, trajectory: JointTrajectory) -> AnyResult:
        """Find the outcome and the measures of one trial.

        The first of these outcomes that holds counts; everything that can be measured is measured in any case:

        1. ``tracking_failed``: a sample is not finite (then nothing is measured), or a goal was canceled or aborted.
        2. The failure that the task itself finds (see `assess`).
        3. ``limit_violated``: a joint violated a limit (see `explain_violation`).
        4. The success of the task.

        Args:
            samples: The recorded trial, at least two samples.
            header: Contacts, goals and start of the trial; the trajectory starts at its `start_ns`.
            trajectory: The trajectory that the controllers followed as a quintic curve and then held at its end.
        """
        trajectory = commanded_trajectory(self.config, samples, planned=trajectory)
        success = self.results(self.outcomes(self.config.task.success))
        measured = measure_joints(success, samples, header.start_ns, config=self.config, trajectory=trajectory)
        if not (measured and math.isfinite(samples.object_position.sum() + samples.object_linear_velocity.sum())):
            reason = "the samples hold numbers that are not finite"
            return self.results(self.outcomes(TRACKING_FAILED), reason=reason)
        result, failure = self.assess(measured, samples, header)
        if refusal := explain_failed_goal(header):
            failure = Failure(self.outcomes(TRACKING_FAILED), refusal)
        elif failure is None and (violation := explain_violation(result)):
            failure = Failure(self.outcomes(LIMIT_VIOLATED), violation)
        if failure:
            result = replace(result, outcome=failure.outcome, reason=failure.reason)
        return result

    @property
    def end_height_m(self) -> float:
        """Height through which the object's centre falls when `end_rule` ends a trial [m]; only speed depends on it."""
        return self.config.scene.landing_height_m + object_of(self.config).radius_m

    def end_rule(self) -> EndRule:
        """Make the rule by which a trial ends as ``landed``; trials also end when all is at rest, or time is over.

        By default, the object's lowest point has crossed the landing plane downwards, while neither the tool nor a body
        of the scene pressed on it: what hits a thin body at speed gets into it for a moment. The
        lowest point is that of the sphere around the object.
        """
        plane_m, holders = self.end_height_m, {self.config.tool.name, *self.config.bodies}

        def has_landed(before: Sequence[float], now: Sequence[float], touching: Collection[str]) -> EndReason | None:
            return "landed" if now[HEIGHT] < plane_m <= before[HEIGHT] and holders.isdisjoint(touching) else None

        return has_landed

    def stands(self, body: str) -> bool:
        """Whether a name in contacts is that of the ground, or of a body of the world: neither tool nor robot."""
        return body == GROUND or body in self.config.bodies

    def final_state(self, samples: Samples, header: EpisodeHeader) -> ObjectState:
        """Return the object in the last sample."""
        (x, y, z), (vx, vy, vz) = samples.object_position[-1].tolist(), samples.object_linear_velocity[-1].tolist()
        return ObjectState(header.seconds_at(int(samples.stamps_ns[-1])), (x, y, z), (vx, vy, vz))

    @abstractmethod
    def assess(self, result: AnyResult, samples: Samples, header: EpisodeHeader) -> tuple[AnyResult, Failure | None]:
        """Add the measures that only this task has, and find what kept a trial from success.

        Args:
            result: A success, with the measures of the joints.
            samples: The recorded trial, at least two samples; joints' numbers and the object's path are finite.
            header: Contacts, goals and start of the trial.

        Returns:
            The result with the measures of this task, and the failure that this task finds, if there is one.
        """

    def lose(self, reason: str) -> AnyResult:
        """Make the result of a trial of which no simulation returned an episode."""
        return self.results(self.outcomes(LOST), reason=reason)


def task_of(config: Config) -> Task[Any]:
    """Make the task that a configuration describes.

    Raises:
        ConfigError: If the task comes from another package, and cannot be imported.
        MemberError: If the task comes from another package and fails.
    """
    name = config.task.name
    kind = load_part("tasks", name, config.task.implementation)
    with explain_failure("tasks", name, "be made"):
        task: Task[Any] = kind(config)
    return task


def trajectory_of(config: Config) -> JointTrajectory:
    """Plan the motion of the trial that a configuration describes; see `Task.trajectory`.

    With a policy, nothing is planned: the joints rest at the start.

    Raises:
        ConfigError: If there is no usable motion for these parameters.
        MemberError: If the task comes from another package and fails.
    """
    if config.task.policy is not None:
        return rest_at({joint: config.task.start[joint] for joint in config.moving_joints})
    with explain_failure("tasks", config.task.name, "plan its motion"):
        return task_of(config).trajectory()


def commanded_trajectory(
    config: Config, samples: Samples, *, planned: JointTrajectory | None = None
) -> JointTrajectory:
    """Return the motion that was commanded in a trial: the planned one, or else one through the commands of the policy.

    Args:
        config: Configuration of the trial.
        samples: Its recorded samples.
        planned: What `trajectory_of` gives, if that is known.
    """
    planned = planned or trajectory_of(config)
    if config.task.policy is None:
        return planned
    rate_hz = config.task.policy.rate_hz
    # Each command is due when the next one is given. Rounding keeps samples at such instants in the right period.
    number, first = np.unique(np.floor(samples.seconds_since(samples.stamps_ns[0]) * rate_hz + 1e-6), return_index=True)
    times = np.append(0.0, (number + 1) / rate_hz)
    positions = np.vstack((planned.positions[:1], samples.command[first, 1]))
    velocities = np.gradient(positions, times, axis=0)
    velocities[[0, -1]] = 0
    return JointTrajectory(planned.joints, times, positions, velocities, np.gradient(velocities, times, axis=0))
