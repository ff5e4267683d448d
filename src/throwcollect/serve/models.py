"""Models of a directory, as the page shows them: where their throws came down, how they miss, where to aim; by REST."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import BaseModel

from throwcollect.errors import NotFoundError
from throwcollect.learning.adapting import Adaptation
from throwcollect.learning.model import MODEL, POINTS, Model, load_model, read_score
from throwcollect.learning.score import Score
from throwcollect.serve.catalogue import ENTRY

_MOST_POINTS = 2000


class ModelView(BaseModel):
    """What is seen of a model.

    Attributes:
        name: Name of its directory.
        learned_from: Name of the collection that it was learned from.
        throws: Number of throws that it was learned from.
        error: How far throws end from where polynomials predict them that were not fitted to them, median.
        parameters: Keys that aiming chooses.
        targets: Columns that say where a trial ends.
        given: Keys whose values are given with a target, behind it.
        reached: Ends of throws that it was learned from, evenly chosen: values of `targets`.
        adaptation: How it was adapted; None if it was not.
        score: What throwing at targets has shown; None if nobody has thrown.
    """

    name: str
    learned_from: str
    throws: int
    error: float
    parameters: list[str]
    targets: list[str]
    given: list[str]
    reached: list[list[float]]
    adaptation: Adaptation | None
    score: Score | None


class AimView(BaseModel):
    """How to reach a target; see `Aim`."""

    target: list[float]
    parameters: dict[str, float]
    predicted: list[float]
    reachable: bool
    nearest: list[float]


@dataclass(frozen=True)
class Models:
    """The models in a directory, which are only read.

    Attributes:
        directory: The directory that holds a directory for each model. It need not exist.
    """

    directory: Path

    def names(self) -> list[str]:
        """Names of the models."""
        try:
            names = sorted(os.listdir(self.directory))
        except OSError:
            return []
        return [each for each in names if re.fullmatch(ENTRY, each) and (self.directory / each / MODEL).is_file()]

    def view(self, name: str) -> ModelView:
        """Describe a model."""
        model = self._load(name)
        trained, ends = model.trained_on, model.learned.outputs
        return ModelView(
            name=name,
            learned_from=trained.name,
            throws=trained.throws,
            error=trained.error,
            parameters=list(model.parameters),
            targets=list(model.targets),
            given=list(model.given),
            # The step is rounded up, so that there are never more points than allowed.
            reached=ends[:: max(1, -(-len(ends) // _MOST_POINTS))].tolist(),
            adaptation=model.adaptation,
            score=read_score(self.directory / name),
        )

    def aim(self, name: str, target: Sequence[float]) -> AimView:
        """Find parameters for a target: values of the model's targets, then of the keys that are given with them."""
        (aim,) = self._load(name).aim([target])
        return AimView(**aim.as_dict())

    def _load(self, name: str) -> Model:
        # Names of models become names of directories.
        if not re.fullmatch(ENTRY, name) or not (self.directory / name / MODEL).is_file():
            raise NotFoundError(
                f"no model {name!r}", hint=f"throwcollect fit makes models; they belong in {self.directory}"
            )
        directory = self.directory / name
        changed = [path.stat().st_mtime_ns for path in (directory / MODEL, directory / POINTS) if path.exists()]
        return _load(directory, *changed)


@lru_cache(maxsize=8)
def _load(directory: Path, *_changed_ns: int) -> Model:
    return load_model(directory)


def make_model_routes(models: Models) -> APIRouter:
    """Make the routes on models, none of which changes a model."""
    router = APIRouter(prefix="/models")

    @router.get("")
    def names() -> list[str]:
        """Names of all models."""
        return models.names()

    @router.get("/{model}")
    def view(model: str) -> ModelView:
        """The throws that a model was learned from, its misses, and the effect of adapting it."""
        return models.view(model)

    @router.get("/{model}/aim")
    def aim(model: str, at: Annotated[list[float], Query()]) -> AimView:
        """The parameters of a throw at a target: values of the model's targets, then of the keys given with them."""
        return models.aim(model, at)

    return router
