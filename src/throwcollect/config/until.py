"""Base of the sections `until` of all tasks, which say when enough has been collected."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from throwcollect.config.section import Section

Wanted = Annotated[int, Field(ge=1, le=1_000_000)]
"""Number of trials that should end with an outcome."""


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
