"""How far steps that were asked for have come."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class StepRequest:
    """A wish for physics steps while the clock stands still.

    Attributes:
        wanted: Number of steps.
        taken: How many have been taken so far.
        interruption: Why no more will be taken; None if nothing has come in between.
    """

    wanted: int
    taken: int = 0
    interruption: str | None = None

    @property
    def is_over(self) -> bool:
        """Whether no more steps will be taken."""
        return self.interruption is not None or self.taken >= self.wanted
