"""The task of reaching: the robot moves, and the ball does not matter."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.robots.description import robot_of
from throwcollect.tasks.result import Outcome, Result
from throwcollect.tasks.result_columns import JointColumns, measured
from throwcollect.tasks.task import Failure, Task


class ReachOutcome(Outcome):
    """How a motion ended."""

    REACHED = "reached"
    MISSED = "missed"
    LIMIT_VIOLATED = "limit_violated"
    TRACKING_FAILED = "tracking_failed"
    LOST = "lost"


@dataclass(frozen=True)
class ReachResult(Result):
    """Outcome and numbers of a motion.

    Attributes:
        end_error_rad: Of each moving joint: distance from its end in the last sample [rad].
    """

    end_error_rad: Mapping[str, float] | None = measured(
        JointColumns("Distance of {joint} from task.end in the last sample [rad].")
    )


class ReachTask(Task[ReachResult]):
    """A motion succeeds when every joint is at its end in the last sample."""

    outcomes = ReachOutcome
    results = ReachResult

    def assess(
        self, result: ReachResult, samples: Samples, header: EpisodeHeader
    ) -> tuple[ReachResult, Failure | None]:
        """Measure how far the joints are from their end; see `Task.assess`."""
        task, joints = self.config.task, robot_of(self.config).joints
        last = dict(zip(joints, samples.position[-1].tolist(), strict=True))
        errors = {joint: abs(last[joint] - end) for joint, end in task.end.items()}
        result = replace(result, end_error_rad=errors)
        worst = max(errors, key=errors.__getitem__)
        if errors[worst] <= task.tolerance_rad:
            return result, None
        return result, Failure(ReachOutcome.MISSED, f"{worst} ended {errors[worst]:.3g} rad away from its end")
