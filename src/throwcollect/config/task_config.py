"""Keys of every task: a motion of some joints, where it should end, and which outcome is a success."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import Field

from throwcollect.config.key import Effect, Key
from throwcollect.config.motion import DynamicMovementPrimitive, MinimumJerk, MotionFile, PolicyConfig, Trajectory
from throwcollect.config.scene import BALL, AnyBody
from throwcollect.config.section import Angle, Joint, Section
from throwcollect.wording import join_names, suggest

Wanted = Annotated[int, Field(ge=1, le=1_000_000)]
"""Number of trials that should end with an outcome."""

TARGET_PREFIX = "target_"
"""Prefix of the columns of targets. No other columns have it: keys have dots, and results have other names."""

LARGEST_TARGET = 1e6
"""Largest number of a target [m, rad, ...]: no robot reaches that far, and powers of it do not overflow."""


@dataclass(frozen=True)
class TargetColumn:
    """A column of lists and tables: a coordinate of where a trial should end; the trial itself does not depend on it.

    Attributes:
        name: Its name, which begins with `TARGET_PREFIX` and ends with its unit.
        of: The column of the task's results, or the key given with a target, that should have the value.
        miss: Column of the table of throws with the miss to which this column contributes.
        word: Its name in sentences.
        description: Its meaning, with the unit.
        required: Whether a target has to have it.
    """

    name: str
    of: str
    miss: str
    word: str
    description: str
    required: bool = False


def target_place(end: str, sentence: str) -> tuple[TargetColumn, ...]:
    """Make the columns of a place in the plane, where a trial should end at the measures ``<end>_x_m`` and ``_y_m``."""
    return tuple(
        TargetColumn(
            f"target_{axis}_m", f"{end}_{axis}_m", "miss_m", axis, f"{sentence}: {axis} in world [m].", required=True
        )
        for axis in "xy"
    )


def is_target(column: str) -> bool:
    """Whether a column of a list or a table is one of targets."""
    return column.startswith(TARGET_PREFIX) and "." not in column


class UntilConfig(Section):
    """Base of the sections `until`: each has one key, the outcome that is counted, which holds a `Wanted`."""

    @classmethod
    def outcome(cls) -> str:
        """Name the outcome that is counted."""
        return next(iter(cls.model_fields))

    @property
    def wanted(self) -> int:
        """Number of trials that should end with that outcome."""
        return int(getattr(self, self.outcome()))


class TaskConfig(Section):
    """Base of the sections of tasks; a member of the family ``tasks`` is a class that is derived from it.

    Attributes:
        implementation: The task itself, ``module:class``: a `Task` that is made of a whole configuration. It is
            imported where it is needed, so that reading a configuration stays cheap.
        until: The section `until` of a configuration of this task; its key is the outcome of a trial that succeeded.
        tool_acts: Whether the tool moves the object, so that a motion in which the tool rests is refused.
        tool: Name of the tool with which `throwcollect init` begins.
        noun: Noun for one of its trials.
        keyword: Keyword by which a hub finds its datasets; empty for its name.
        instruction: What the robot does, as one would ask it to; empty for its name.
        events: Names of the instants among its results, in the order of time; `sweep.target` needs a ``landing``.
        targets: Columns of its results that say where a trial ended, and that can be aimed at; none if there is
            nothing to aim at.
        given: Keys whose values belong to a target, in the order in which they follow it: aiming does not choose them.
        informative: Outcomes besides the success of trials that also show where a motion leads: models learn from them.
        target_columns: Columns of targets that lists of its trials may have, in the order of the table of throws; none
            if its trials have no targets.
    """

    implementation: ClassVar[str]
    until: ClassVar[type[UntilConfig]]
    tool_acts: ClassVar[bool] = False
    tool: ClassVar[str] = "spoon"
    noun: ClassVar[str] = "trial"
    keyword: ClassVar[str] = ""
    instruction: ClassVar[str] = ""
    events: ClassVar[tuple[str, ...]] = ()
    targets: ClassVar[tuple[str, ...]] = ()
    given: ClassVar[tuple[str, ...]] = ()
    informative: ClassVar[tuple[str, ...]] = ()
    target_columns: ClassVar[tuple[TargetColumn, ...]] = ()

    name: str
    """Task."""
    start: Annotated[dict[Joint, Angle], Key(Effect.PHYSICS, swept=True)]
    """Joint angles at the start of each trial."""
    end: Annotated[dict[Joint, Angle], Key(swept=True)]
    """Joint angles at the end of the motion. The joints named here are the moving ones, even if end equals start."""
    duration_s: Annotated[float, Field(ge=0.1, le=10), Key(swept=True)] = 1.0
    """Duration of the motion (tau of a DMP)."""
    trajectory: Annotated[Trajectory, Key(swept=True)] = MinimumJerk()
    """How the joints go from start to end."""
    points_hz: Annotated[float, Field(ge=5, le=1000)] = 25.0
    """Points per second of the joint trajectories that are sent to the controllers (quintic between them)."""
    policy: Annotated[PolicyConfig | None, Key(Effect.PHYSICS, swept=False)] = None
    """Policy that commands the joints of `end` step by step, in place of a motion from `start` to `end`."""

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Refuse a task without `until`: all configurations need to know the keys of that section."""
        if not hasattr(cls, "until"):
            raise TypeError(f"{cls.__qualname__} lacks until")

    @property
    def success(self) -> str:
        """Outcome of a trial that succeeded."""
        return self.until.outcome()

    @property
    def bodies(self) -> Mapping[str, AnyBody]:
        """Bodies that the task puts into the world, by name; none by default."""
        return {}

    @property
    def object(self) -> str | None:
        """Name of the body that the robot acts on in the place of the ball; None for the ball."""
        return None

    @property
    def subject(self) -> str:
        """Description of its trials, for a sentence in which it follows their number."""
        return f"{self.noun}s of " + (f"the task {self.name}" if self.noun == "trial" else f"a {self.object or BALL}")

    def find_wrong_targets(self, columns: Collection[str]) -> dict[str, str]:
        """Explain what is wrong with the names of the columns of targets of a list of its trials, or of one trial.

        Returns:
            What is wrong, by column; empty if they are targets of this task, or none at all.
        """
        known = {each.name: each for each in self.target_columns}
        unknown = f"the task {self.name} has no such target"
        wrong = {name: unknown + suggest(name, known) for name in columns if name not in known}
        if there := [name for name in known if name in columns]:
            missing = (name for name, each in known.items() if each.required and name not in columns)
            wrong |= {name: f"is missing, as there is {join_names(there)}" for name in missing}
        return wrong

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        if not self.end:
            yield "end", "names no joint, so nothing would move"
        if isinstance(self.trajectory, DynamicMovementPrimitive):
            for joint in self.trajectory.weights:
                if joint not in self.end:
                    yield f"trajectory.weights.{joint}", "end does not name this joint, so it does not move"
        elif isinstance(self.trajectory, MotionFile):
            for name in ("duration_s", "points_hz"):
                if getattr(self, name) != type(self).model_fields[name].default:
                    yield name, "should be left out, as the file of motions has times"
