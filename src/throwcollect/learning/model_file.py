"""``model.json``: a learned map without the throws that it was learned from."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, FiniteFloat

from throwcollect.learning.adapting import Adaptation
from throwcollect.learning.arrays import ModelEntry
from throwcollect.learning.distilling import DistilledMap
from throwcollect.learning.learned_map import Axis, Correction, Kind
from throwcollect.learning.polynomial import Polynomial


class TrainedOn(ModelEntry):
    """The dataset and the throws that the model was learned from.

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
        without_latents: The same distance when latents are no inputs; None if there are no latents.
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
    folds_error: dict[int, FiniteFloat] = Field(min_length=1)
    without_latents: FiniteFloat | None
    latents_count: bool

    @property
    def error(self) -> float:
        """The smallest of the errors, which belongs to the chosen degree."""
        return min(self.folds_error.values())


class ModelFile(ModelEntry):
    """The whole file.

    Attributes:
        version: Version of throwcollect that made it.
        kind: How predictions are made.
        axes: The inputs: parameters, then context, then latents.
        targets: Columns of the table of throws that say where a trial ended.
        forward: The polynomial: all inputs to targets.
        effort: The polynomial of the largest share of a joint's torque limit.
        correction: How the world differs from the dataset's.
        trained_on: The throws that it was learned from.
        adaptation: How it was adapted; None if it was not.
        distilled: A polynomial from targets to parameters; None if it was not distilled.
    """

    format: Literal["1"] = "1"
    version: str
    kind: Kind
    axes: tuple[Axis, ...] = Field(min_length=1)
    targets: tuple[str, ...] = Field(min_length=1)
    forward: Polynomial
    effort: Polynomial
    correction: Correction
    trained_on: TrainedOn
    adaptation: Adaptation | None
    distilled: DistilledMap | None = None
