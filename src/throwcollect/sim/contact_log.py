"""Notes which bodies press on the ball, and for how long."""

from __future__ import annotations

from collections.abc import Callable, Collection, Set

from throwcollect.episode.record import Contact


class ContactLog:
    """Intervals, counted in physics steps, in which bodies press on the ball."""

    def __init__(self) -> None:
        self._open: dict[str, int] = {}
        self._closed: list[tuple[int, str, int]] = []

    @property
    def bodies(self) -> Collection[str]:
        """Names of the bodies that press on the ball now."""
        return self._open.keys()

    def update(self, bodies: Set[str], step: int) -> None:
        """Note the names of all bodies that press on the ball from a step on; steps must ascend from call to call."""
        for body in self._open.keys() - bodies:
            self._closed.append((self._open.pop(body), body, step))
        for body in bodies - self._open.keys():
            self._open[body] = step

    def intervals(self, stamp_ns: Callable[[int], int]) -> tuple[Contact, ...]:
        """List all intervals by start time, then by name; `stamp_ns` gives the time [ns] at the end of a step."""
        ended = [(start, body, stamp_ns(end)) for start, body, end in self._closed]
        lasting = [(start, body, None) for body, start in self._open.items()]
        return tuple(
            Contact(body=body, start_ns=stamp_ns(start), end_ns=end_ns)
            # Only start and body are compared: the end of an interval that lasts is None, which cannot be compared.
            for start, body, end_ns in sorted([*ended, *lasting], key=lambda interval: interval[:2])
        )
