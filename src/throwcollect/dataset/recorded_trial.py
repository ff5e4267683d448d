"""A trial as it was recorded, beside what it was simulated with, for the checks of headers and of motion."""

from __future__ import annotations

import reprlib
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.control import GoalStatus
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.units import NS_PER_S

_short = reprlib.Repr()
_short.maxstring = 60
shorten = _short.repr
"""Writes a value in words, and cuts it, as a forged file may hold a very long one."""


@dataclass(frozen=True, eq=False)
class RecordedTrial:
    """The samples of a trial with its header, its configuration, and the trajectory that its controllers were sent.

    The samples are finite and have the stamps that belong to the trial. Its time is counted in physics steps: the first
    sample is at step 0.
    """

    samples: Samples
    header: EpisodeHeader
    config: Config
    trajectory: JointTrajectory

    @cached_property
    def stride(self) -> int:
        """Physics steps from one sample to the next."""
        return self.config.sim.physics_hz // self.config.record.rate_hz

    @cached_property
    def last_step(self) -> int:
        """The step of the last sample."""
        return self.stride * (len(self.samples) - 1)

    @cached_property
    def times_s(self) -> NDArray[np.float64]:
        """Times of the samples since the start of the trial [s], shape ``(n_samples,)``."""
        return self.samples.seconds_since(self.header.start_ns)

    @cached_property
    def motion_s(self) -> float:
        """How long the motion lasts by the clock of the controllers, which may be faster or slower than planned [s]."""
        return float(self.trajectory.times[-1]) / self.config.robot.speed_scale

    @cached_property
    def has_failed_goal(self) -> bool:
        """Whether a goal was canceled or aborted; then the joints need not have followed their trajectory."""
        return any(goal.status in (GoalStatus.CANCELED, GoalStatus.ABORTED) for goal in self.header.goals)

    def step_at(self, instant_ns: int) -> int | None:
        """Find the step that ends at an instant [ns]; None if no step of the trial does."""
        hz = self.config.sim.physics_hz
        step = round((instant_ns - self.header.start_ns) * hz / NS_PER_S)
        # The simulation's clock is rounded down like this, so a true instant of a step is hit to the nanosecond.
        on_step = self.header.start_ns + step * NS_PER_S // hz == instant_ns
        return step if on_step and 0 <= step <= self.last_step else None

    def steps_of(self, contact: Contact) -> tuple[int, int] | None:
        """Find the first step of a contact and the one after its last; None if these are no two steps in order."""
        begin = self.step_at(contact.start_ns)
        end = self.last_step + 1 if contact.end_ns is None else self.step_at(contact.end_ns)
        return None if begin is None or end is None or end <= begin else (begin, end)

    def find_pressed(self, contacts: Collection[Contact]) -> NDArray[np.bool_]:
        """Find the samples at which at least one of these contacts lasts, shape ``(n_samples,)``."""
        steps = np.arange(0, self.last_step + 1, self.stride)
        pressed = np.zeros(len(steps), dtype=bool)
        for interval in map(self.steps_of, contacts):
            if interval is not None:
                pressed |= (steps >= interval[0]) & (steps < interval[1])
        return pressed

    def name_contact(self, contact: Contact) -> str:
        """Name a contact in words; a long name of its body is cut."""
        return f"the contact with {shorten(contact.body)} at {self.format_time(contact.start_ns)}"

    def format_time(self, instant_ns: int) -> str:
        """Write an instant as the time since the start of the trial."""
        return f"{self.header.seconds_at(instant_ns):.3f} s"
