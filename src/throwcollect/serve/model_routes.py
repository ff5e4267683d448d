"""REST on models: to look at them, and to aim with them."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from throwcollect.serve.models import AimView, Models, ModelView


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
