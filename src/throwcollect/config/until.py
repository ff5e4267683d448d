"""Base of the sections `until` of all tasks, which say when enough has been collected."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from throwcollect.config.section import Section

Wanted = Annotated[int, Field(ge=1, le=1_000_000)]
"""Number of trials that should end with an outcome."""


class UntilConfig(Section):
    """Base of the sections `until`: each has one key, the outcome that is counted, which holds a `Wanted`."""

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Refuse a section that has no key, or several."""
        if len(cls.model_fields) != 1:
            keys = ", ".join(cls.model_fields) or "none"
            raise TypeError(f"{cls.__qualname__} should have one key, the outcome that is counted; it has {keys}")

    @classmethod
    def outcome(cls) -> str:
        """Name the outcome that is counted."""
        return next(iter(cls.model_fields))

    @property
    def wanted(self) -> int:
        """Number of trials that should end with that outcome."""
        return int(getattr(self, self.outcome()))
