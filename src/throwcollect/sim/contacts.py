"""Which bodies press on the ball, and for how long."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Set

from throwcollect.episode.record import Contact

Surface = tuple[int, int]
"""Body and link number in the physics engine."""


class ContactLog:
    """Intervals, counted in physics steps, in which bodies press on the ball.

    Args:
        names: Name of the body that each surface belongs to.
    """

    def __init__(self, names: Mapping[Surface, str]) -> None:
        self._names = names
        self._open: dict[str, int] = {}
        self._closed: list[tuple[int, str, int]] = []

    @property
    def bodies(self) -> Collection[str]:
        """Names of the bodies that press on the ball now."""
        return self._open.keys()

    def update(self, pressing: Set[Surface], step: int) -> None:
        """Take note of what presses on the ball since a step.

        Args:
            pressing: All surfaces that pressed on the ball.
            step: Number of the step; later than that of the call before.
        """
        bodies = {self._names[surface] for surface in pressing}
        for body in self._open.keys() - bodies:
            self._closed.append((self._open.pop(body), body, step))
        for body in bodies - self._open.keys():
            self._open[body] = step

    def intervals(self, stamp_ns: Callable[[int], int]) -> tuple[Contact, ...]:
        """All intervals so far, by start time, then by name.

        Args:
            stamp_ns: Simulated time [ns] at the end of a step.
        """
        ended = [(start, body, stamp_ns(end)) for start, body, end in self._closed]
        lasting = [(start, body, None) for body, start in self._open.items()]
        return tuple(
            Contact(body=body, start_ns=stamp_ns(start), end_ns=end_ns)
            for start, body, end_ns in sorted([*ended, *lasting], key=lambda interval: interval[:2])
        )
