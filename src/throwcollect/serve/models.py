"""Models of a directory, as the page shows them: where their throws came down, how they miss, where to aim; by REST."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import BaseModel

from throwcollect.errors import NotFoundError
from throwcollect.learning.adapting import Adaptation
from throwcollect.learning.model import MODEL, Model, load_model, read_score
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
        targets: Columns of where a trial ends.
        given: Keys whose values are given with a target, behind it.
        reached: Ends of throws that it was learned from, evenly chosen: values of `targets`.
        adaptation: How it was adapted; None if it was not.
        score: What throwing at targets has shown; None if there was no throw.
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


def make_model_routes(directory: Path) -> APIRouter:
    """Make the routes on the models of a directory, which need not exist; none of them changes a model."""
    router = APIRouter(prefix="/models")

    @router.get("")
    def names() -> list[str]:
        """Names of all models."""
        if not directory.is_dir():
            return []
        return [each for each in sorted(os.listdir(directory)) if _is_model(directory, each)]

    @router.get("/{model}")
    def view(model: str) -> ModelView:
        """The throws that a model was learned from, its misses, and the effect of adapting it."""
        found = _find(directory, model)
        trained, ends = found.trained_on, found.outputs
        return ModelView(
            name=model,
            learned_from=trained.name,
            throws=trained.throws,
            error=found.error,
            parameters=list(found.parameters),
            targets=list(found.targets),
            given=list(found.given),
            # The step is rounded up, so that there are never more points than allowed.
            reached=ends[:: max(1, -(-len(ends) // _MOST_POINTS))].tolist(),
            adaptation=found.adaptation,
            score=read_score(directory / model),
        )

    @router.get("/{model}/aim")
    def aim(model: str, at: Annotated[list[float], Query()]) -> dict[str, Any]:
        """The parameters of a throw at a target: values of the model's targets, then of the keys given with them."""
        (found,) = _find(directory, model).aim([at])
        return found.as_dict()

    return router


def _is_model(directory: Path, name: str) -> bool:
    # Names of models become names of directories.
    return bool(re.fullmatch(ENTRY, name)) and (directory / name / MODEL).is_file()


def _find(directory: Path, name: str) -> Model:
    if not _is_model(directory, name):
        raise NotFoundError(f"no model {name!r}", hint=f"throwcollect fit makes models; they belong in {directory}")
    return load_model(directory / name)
