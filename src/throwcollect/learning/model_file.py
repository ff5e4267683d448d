"""``model.json``: everything that a learned map is, but for the throws that it was learned from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from throwcollect.errors import DatasetError
from throwcollect.files import read_text
from throwcollect.learning.adapting import ROLES, Method
from throwcollect.learning.distilling import DistilledMap
from throwcollect.learning.learned_map import Axis, Correction, Kind, LearnedMap, Role
from throwcollect.learning.polynomial import Polynomial

MODEL = "model.json"
_MOST_BYTES = 100_000_000


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class AxisEntry(_Entry):
    """An input of the map; see `Axis`."""

    key: str
    role: Role
    minimum: FiniteFloat
    maximum: FiniteFloat
    nominal: FiniteFloat

    def to_axis(self) -> Axis:
        """Make the axis."""
        return Axis(self.key, self.role, self.minimum, self.maximum, self.nominal)


class PolynomialEntry(_Entry):
    """A polynomial of scaled inputs: a row of exponents and one of coefficients for each term."""

    exponents: list[list[Annotated[int, Field(ge=0, le=10)]]]
    coefficients: list[list[FiniteFloat]]

    @classmethod
    def of(cls, polynomial: Polynomial) -> PolynomialEntry:
        """Take down a polynomial."""
        return cls(exponents=polynomial.exponents.tolist(), coefficients=polynomial.coefficients.tolist())

    def to_polynomial(self) -> Polynomial:
        """Make the polynomial."""
        return Polynomial(np.array(self.exponents, np.int64), np.array(self.coefficients, np.float64))

    def has_shape(self, inputs: int, outputs: int) -> bool:
        """Whether all rows belong to so many inputs and outputs."""
        return (
            0 < len(self.exponents) == len(self.coefficients)
            and all(len(row) == inputs for row in self.exponents)
            and all(len(row) == outputs for row in self.coefficients)
        )


class CorrectionEntry(_Entry):
    """How the world differs from the dataset's; see `Correction`."""

    bias: list[FiniteFloat]
    latents: list[FiniteFloat]
    offset: list[FiniteFloat]

    @classmethod
    def of(cls, correction: Correction) -> CorrectionEntry:
        """Take down a correction."""
        return cls(
            bias=correction.bias.tolist(), latents=correction.latents.tolist(), offset=correction.offset.tolist()
        )

    def to_correction(self) -> Correction:
        """Make the correction."""
        arrays: list[NDArray[np.float64]] = [
            np.array(each, np.float64) for each in (self.bias, self.latents, self.offset)
        ]
        return Correction(*arrays)


class DistilledEntry(_Entry):
    """The way from a target to parameters as one polynomial; see `DistilledMap`."""

    low: list[FiniteFloat]
    high: list[FiniteFloat]
    polynomial: PolynomialEntry

    @classmethod
    def of(cls, distilled: DistilledMap) -> DistilledEntry:
        """Take down what was distilled."""
        polynomial = PolynomialEntry.of(distilled.polynomial)
        return cls(low=distilled.low.tolist(), high=distilled.high.tolist(), polynomial=polynomial)

    def to_map(self) -> DistilledMap:
        """Make the map."""
        low, high = np.array(self.low, np.float64), np.array(self.high, np.float64)
        return DistilledMap(low, high, self.polynomial.to_polynomial())

    def has_shape(self, targets: int, context: int, parameters: int) -> bool:
        """Whether all numbers belong to so many targets, keys that are given, and parameters."""
        return (
            len(self.low) == len(self.high) == targets
            and all(low < high for low, high in zip(self.low, self.high, strict=True))
            and self.polynomial.has_shape(targets + context, parameters)
        )


class Found(_Entry):
    """A number that adaptation found.

    Attributes:
        name: A key, whose value in this world it is, or that differs by it; or a target, which is moved by it.
        value: In the unit of the name.
        deviation: Its standard deviation.
    """

    name: str
    value: FiniteFloat
    deviation: FiniteFloat


class AdaptationEntry(_Entry):
    """How the model was adapted.

    Attributes:
        method: What the world is taken to differ by.
        throws: Number of throws.
        scatter: Standard deviation that was taken for each measured coordinate, in the unit of the targets.
        before: Distances of the throws from where they had been predicted.
        after: The same, each by a model that was adapted to all others; empty for a single throw.
        found: What was found.
    """

    method: Method
    throws: int
    scatter: FiniteFloat
    before: list[FiniteFloat]
    after: list[FiniteFloat]
    found: list[Found]


class TrainedOn(_Entry):
    """What the model was learned from.

    Attributes:
        name: Name of the collection.
        robot: Name of the robot.
        task: Name of the task.
        engine: Name of the physics engine.
        digest: Digest of the dataset.
        throws: Number of throws that it was learned from.
        ignored: Number of throws that did not succeed.
        selection: The condition on throws; None for all.
        folds_error: By degree: median distance of throws from their prediction by polynomials fitted to others.
        without_latents: The same for the chosen degree without latents; None if there are none.
        latents_count: Whether latents have an effect that is worth knowing.
    """

    name: str
    robot: str
    task: str
    engine: str
    digest: str
    throws: int
    ignored: int
    selection: str | None
    folds_error: dict[int, FiniteFloat]
    without_latents: FiniteFloat | None
    latents_count: bool

    @property
    def error(self) -> float:
        """The smallest of the errors, which is that of the degree that was chosen."""
        return min(self.folds_error.values())


class ModelFile(_Entry):
    """The whole file. Its numbers and its order are a pure function of the dataset and of what was asked for."""

    format: Literal["1"] = "1"
    version: str
    kind: Kind
    axes: list[AxisEntry] = Field(min_length=1)
    targets: list[str] = Field(min_length=1)
    forward: PolynomialEntry
    effort: PolynomialEntry
    correction: CorrectionEntry
    trained_on: TrainedOn
    adaptation: AdaptationEntry | None
    distilled: DistilledEntry | None = None

    @model_validator(mode="after")
    def _fits_together(self) -> ModelFile:
        inputs, targets = len(self.axes), len(self.targets)
        roles = [axis.role for axis in self.axes]
        if not (
            self.forward.has_shape(inputs, targets)
            and self.effort.has_shape(inputs, 1)
            and len(self.correction.bias) == roles.count(Role.PARAMETER) > 0
            and len(self.correction.latents) == roles.count(Role.LATENT)
            and len(self.correction.offset) == targets
            and roles == sorted(roles, key=list(Role).index)
            and all(axis.minimum < axis.maximum for axis in self.axes)
            and (
                self.distilled is None
                or self.distilled.has_shape(targets, roles.count(Role.CONTEXT), roles.count(Role.PARAMETER))
            )
        ):
            raise ValueError("axes, targets, polynomials and correction do not belong together")
        return self


def read_model_file(directory: Path) -> ModelFile:
    """Read ``model.json``.

    Args:
        directory: Directory of the model.

    Raises:
        DatasetError: If it cannot be read, or is no such file.
    """
    path = directory / MODEL
    try:
        return ModelFile.model_validate_json(read_text(path, most_bytes=_MOST_BYTES))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise DatasetError(
            f"{where + ': ' if where else ''}{first['msg']}", path=path, hint="throwcollect fit makes models"
        ) from error


def list_found(learned: LearnedMap, method: Method, deviations: NDArray[np.float64]) -> list[Found]:
    """List the numbers that adaptation found, in their units.

    Args:
        learned: The adapted map.
        method: What differs in its world.
        deviations: As `Adaptation` has them.
    """
    if method is Method.NONE:
        return []
    role = ROLES.get(method)
    axes = learned.axes_of(role) if role else ()
    found = []
    for number, axis in enumerate(axes):
        half = (axis.maximum - axis.minimum) / 2
        if role is Role.LATENT:
            value = axis.minimum + (float(learned.correction.latents[number]) + 1) * half
        else:
            value = float(learned.correction.bias[number]) * half
        found.append(Found(name=axis.key, value=value, deviation=float(deviations[number]) * half))
    offsets = zip(learned.targets, learned.correction.offset.tolist(), deviations[len(axes) :].tolist(), strict=True)
    return [*found, *(Found(name=name, value=value, deviation=spread) for name, value, spread in offsets)]
