"""``model.json``: a learned map without the throws that it was learned from."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, FiniteFloat, ValidationError

from throwcollect.dataset.directory import has_files
from throwcollect.dataset.misses import find_median
from throwcollect.errors import DatasetError
from throwcollect.files import read_text, suggest_path
from throwcollect.learning.adapting import ROLES, Method
from throwcollect.learning.arrays import Array, ModelEntry
from throwcollect.learning.distilling import DistilledMap
from throwcollect.learning.learned_map import Axis, Correction, KeyRole, Kind, LearnedMap
from throwcollect.learning.polynomial import Polynomial
from throwcollect.wording import command

MODEL = "model.json"
_MOST_BYTES = 100_000_000


class AdaptedNumber(ModelEntry):
    """A number that adaptation found.

    Attributes:
        name: A latent, which has `value` in this world; or a parameter or a target, to which `value` is added.
        value: In the unit of the name.
        deviation: Standard deviation of `value`.
    """

    name: str
    value: FiniteFloat
    deviation: FiniteFloat


class AdaptationEntry(ModelEntry):
    """How the model was adapted.

    Attributes:
        method: How the world is assumed to differ.
        throws: Number of throws.
        scatter: Standard deviation that was assumed for each measured coordinate, in the unit of the targets.
        before: Distances of the throws from where the model predicted them before it was adapted.
        after: The same distances, each from the prediction of a model that was adapted to the other throws; empty for a
            single throw.
        found: The numbers that were found.
    """

    method: Method
    throws: int
    scatter: FiniteFloat
    before: list[FiniteFloat]
    after: list[FiniteFloat]
    found: list[AdaptedNumber]

    @property
    def medians(self) -> tuple[float | None, float | None]:
        """Medians of `before` and of `after`; None if there are no distances."""
        return find_median(self.before), find_median(self.after)


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
    """The whole file: a pure function of the dataset and of the arguments of `fit`, `adapt` and `distil`."""

    format: Literal["1"] = "1"
    version: str
    kind: Kind
    axes: tuple[Axis, ...] = Field(min_length=1)
    targets: tuple[str, ...] = Field(min_length=1)
    forward: Polynomial = Field(repr=False)
    effort: Polynomial = Field(repr=False)
    correction: Correction
    trained_on: TrainedOn
    adaptation: AdaptationEntry | None
    distilled: DistilledMap | None = Field(default=None, repr=False)


def read_model_file(directory: Path) -> ModelFile:
    """Read ``model.json`` from the directory of a model."""
    path = directory / MODEL
    try:
        text = read_text(path, most_bytes=_MOST_BYTES)
    except DatasetError as error:
        if not isinstance(error.__cause__, FileNotFoundError):
            raise
        # Users easily give a dataset in place of its model, so the hint makes a model of it.
        dataset = directory if has_files(directory) else "DATASET"
        hint = command("fit", dataset, "-o", "MODEL")
        problem = f"holds no model: there is no {MODEL}{suggest_path(directory)}"
        raise DatasetError(problem, path=directory, hint=hint) from error
    try:
        return ModelFile.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise DatasetError(
            f"{where + ': ' if where else ''}{first['msg']}", path=path, hint="throwcollect fit makes models"
        ) from error


def list_found(learned: LearnedMap, method: Method, deviations: Array) -> list[AdaptedNumber]:
    """List the numbers that adaptation found, in their units: of the adapted map and of an `Adaptation`."""
    if method is Method.NONE:
        return []
    role = ROLES.get(method)
    axes = learned.axes_of(role) if role else ()
    found = []
    for number, axis in enumerate(axes):
        half = (axis.maximum - axis.minimum) / 2
        if role is KeyRole.LATENT:
            value = axis.minimum + (float(learned.correction.latents[number]) + 1) * half
        else:
            value = float(learned.correction.bias[number]) * half
        found.append(AdaptedNumber(name=axis.key, value=value, deviation=float(deviations[number]) * half))
    offsets = zip(learned.targets, learned.correction.offset.tolist(), deviations[len(axes) :].tolist(), strict=True)
    return [*found, *(AdaptedNumber(name=name, value=value, deviation=spread) for name, value, spread in offsets)]
