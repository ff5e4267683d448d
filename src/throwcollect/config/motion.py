"""Keys of what moves the joints: the families of motions from a start to an end, or a policy step by step."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, PositiveFloat

from throwcollect.config.key import Effect, Key
from throwcollect.config.section import Joint, Section, any_of


class MinimumJerk(Section):
    """q(t) = q0 + (q1 - q0) s((t/T)^gamma), s(x) = 10x³ - 15x⁴ + 6x⁵."""

    family: Literal["minimum_jerk"] = "minimum_jerk"
    """Trajectory family."""
    gamma: Annotated[float, Field(ge=0.67, le=3)] = 1.2
    """Time warp [-]: above 1 the speed peak comes later."""


class DynamicMovementPrimitive(Section):
    """Joint-space discrete DMP: tau z' = alpha_z (beta_z (g - y) - z) + f(x), tau y' = z, tau x' = -alpha_x x."""

    family: Literal["dmp"]
    """Trajectory family."""
    basis_functions: Annotated[int, Field(ge=2, le=500)] = 20
    """Number of Gaussian basis functions of each joint."""
    weights: dict[Joint, list[Annotated[float, Field(json_schema_extra={"unit": "rad"})]]] = {}
    """Weights of the forcing term of each moving joint; a joint that is absent has zero weights [rad]."""
    alpha_z: Annotated[float, Field(gt=0, le=1000)] = 48.0
    """Stiffness constant of the transformation system [-]; beta_z is alpha_z / 4 (critically damped)."""
    alpha_x: PositiveFloat = 2.0
    """Decay constant of the phase [-]."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        for joint, weights in self.weights.items():
            if len(weights) != self.basis_functions:
                yield (
                    f"weights.{joint}",
                    f"should be basis_functions = {self.basis_functions} numbers, got {len(weights)}",
                )


class MotionFile(Section):
    """Motions of a file, as quintics between its points; each begins and ends at rest."""

    family: Literal["file"]
    """Trajectory family."""
    file: Annotated[str, Key(Effect.RUN, swept=False, operator=True)]
    """CSV, Parquet, npz, HDF5 or MCAP file, a directory of such files, or a LeRobot dataset
    (docs/robots.md); a relative path starts at the directory of the configuration file."""
    motion: Annotated[float, Field(ge=0, multiple_of=1)] | str | None = None
    """The motion, by its number in the file, from 0, or by its name; null: each trial has the next one, and after the
    last one the first one again."""
    joints: Annotated[list[Joint | None], Key(Effect.RUN, swept=False)] = []
    """Joints of the columns of an array that names none, in their order; null leaves a column out."""
    rate_hz: Annotated[PositiveFloat | None, Key(Effect.RUN, swept=False)] = None
    """Points per second of a file that has no times."""
    sha256: str | None = None
    """Digest of the motions; it is written with a dataset."""


if TYPE_CHECKING:
    Trajectory = MinimumJerk | DynamicMovementPrimitive | MotionFile
else:
    Trajectory = any_of(
        {"minimum_jerk": MinimumJerk, "dmp": DynamicMovementPrimitive, "file": MotionFile},
        lambda value: value.get("family", "minimum_jerk") if isinstance(value, dict) else None,
    )


SESSION = "session"
"""`task.policy.use` of a dataset that clients of a session have recorded; nothing can be simulated by it."""


class PolicyConfig(Section):
    """A policy in the loop."""

    use: str
    """Function that makes the policy: `module:function`, or the name that a package gives it (docs/learning.md)."""
    rate_hz: Annotated[int, Field(ge=1, le=10000)] = 50
    """Commands per simulated second; must divide `sim.physics_hz`."""
    observation: list[str] = []
    """Arrays that the policy gets; empty for all that there are but pictures."""
    command: Literal["position", "velocity"] = "position"
    """What the policy commands for each joint of `task.end`: the position at the next command [rad], or the velocity
    until then [rad/s]."""
    timeout_s: Annotated[float, Field(gt=0, le=3600), Key(Effect.RUN)] = 3.0
    """Real time that one command may take."""
    reproducible: Annotated[bool, Key(Effect.PLAN)] = True
    """Whether the policy is a function of its seed and its observations; if not, no trial is simulated again at the
    end, and the data card states it."""
