"""Keys of the families of motions: how joints go from a start to an end."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, PositiveFloat

from throwcollect.config.kinds import Joint
from throwcollect.config.section import Section, any_of


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


if TYPE_CHECKING:
    Trajectory = MinimumJerk | DynamicMovementPrimitive
else:
    Trajectory = any_of(
        {"minimum_jerk": MinimumJerk, "dmp": DynamicMovementPrimitive},
        lambda value: value.get("family", "minimum_jerk") if isinstance(value, dict) else None,
    )
