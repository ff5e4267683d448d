"""Following one trajectory after another, update by update; goals and tolerances are the controller's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.goal import Trajectory, TrajectoryPoint
from throwcollect.control.interpolation import interpolate
from throwcollect.control.motion import Motion
from throwcollect.control.outcome import ControllerState, JointState, TrajectoryState
from throwcollect.control.parameters import ControllerParameters
from throwcollect.control.waypoints import StartState, Waypoints, arrange


class Tracker:
    """Commands and measured state of a controller's joints, from update to update.

    Args:
        name: Name of the controller, for texts.
        parameters: Of these, those that never change matter.
        period_ns: Control period [ns].

    Raises:
        ValueError: If the period is not above 0.
    """

    def __init__(self, name: str, parameters: ControllerParameters, *, period_ns: int) -> None:
        if period_ns <= 0:
            raise ValueError(f"{name}: period_ns must be above 0, got {period_ns}")
        self._name = name
        self._parameters = parameters
        self.period_ns = period_ns
        self.time_ns = 0
        self.command: NDArray[np.float64] = np.zeros(len(parameters.joints))
        """Last commanded positions [rad], shape ``(n_joints,)``, read-only."""
        self.incoming: Trajectory | Waypoints | None = None
        """What to follow from the next update on."""
        self._motion: Motion | None = None
        self._measured: JointState | None = None
        self._scaling = 1.0

    @property
    def scaling(self) -> float:
        """Speed of the trajectory's clock [-]."""
        return self._scaling

    @scaling.setter
    def scaling(self, factor: float) -> None:
        if factor != self._scaling:
            self._scaling = factor
            if self._motion is not None:
                self._motion.scale(factor)

    @property
    def motion(self) -> Motion:
        """What is being followed.

        Raises:
            ValueError: If there was no update yet.
        """
        if self._motion is None:
            raise ValueError(f"{self._name}: there was no update yet")
        return self._motion

    @property
    def measured(self) -> JointState:
        """State that was measured in the last update.

        Raises:
            ValueError: If it is unknown, since updates were taken without looking.
        """
        if self._measured is None:
            raise ValueError(f"{self._name}: the measured state is unknown; call observe after take")
        return self._measured

    def restart(self, time_ns: int, measured: JointState) -> None:
        """Begin anew, with the measured positions as the last command, at full speed."""
        self.observe(measured)
        self.time_ns = time_ns
        self.command = self.measured.positions
        self._motion = None
        self._scaling = 1.0

    def observe(self, measured: JointState) -> None:
        """Tell the measured state of the last update.

        Raises:
            ValueError: If it lacks what is to be measured.
        """
        fields = (
            [measured.positions, measured.velocities] if self._parameters.measures_velocity else [measured.positions]
        )
        copies = [np.array(field, dtype=float) for field in fields]
        for values in copies:
            if values.shape != self.command.shape:
                raise ValueError(f"{self._name}: measured shape {values.shape}; expected {self.command.shape}")
            values.setflags(write=False)
        self._measured = JointState(*copies)

    def advance(self, time_ns: int, period_ns: int, measured: JointState) -> bool:
        """Go to the next update.

        Args:
            time_ns: Its time [ns].
            period_ns: Time since the update before [ns].
            measured: State at this time.

        Returns:
            Whether something new is followed from now on.

        Raises:
            ValueError: If the state lacks what is to be measured.
        """
        self.observe(measured)
        self.time_ns = time_ns
        if (incoming := self.incoming) is None:
            self.motion.advance(period_ns)
            return False
        self._begin(incoming, StartState(time_ns, self.measured.positions, self.measured.velocities), time_ns)
        return True

    def send(self) -> None:
        """Command what is due one period after this update."""
        self.command = self.motion.command

    def take(self, n_updates: int) -> NDArray[np.float64]:
        """Make many updates at once that need no measured state.

        Args:
            n_updates: Their number, at least 1.

        Returns:
            Their commands [rad], shape ``(n_updates, n_joints)``, read-only.
        """
        commands: NDArray[np.float64]
        if (incoming := self.incoming) is None:
            commands = self.motion.skip(n_updates)
        else:
            # Only a stop can be waiting here, and that does not depend on the measured state.
            motion = self._begin(incoming, StartState(self.time_ns, self.command), self.time_ns + self.period_ns)
            first = motion.command
            rows = motion.skip(n_updates - 1)
            resting = motion.past_end and not motion.curve.end_ns
            commands = np.broadcast_to(first, (n_updates, len(first))) if resting else np.vstack((first, rows))
            commands.setflags(write=False)
        self.time_ns += n_updates * self.period_ns
        self._measured = None
        self.command = commands[-1]
        return commands

    def state(self, time_ns: int | None = None) -> ControllerState:
        """What the last update has seen and done; or what one at a later time would see [ns].

        Raises:
            ValueError: If there was no update yet, or the measured state is unknown.
        """
        motion, measured = self.motion, self.measured
        time_ns = self.time_ns if time_ns is None else time_ns
        clock_ns = motion.clock_ns + round((time_ns - self.time_ns) * self._scaling)
        position, velocity, acceleration = motion.curve.state(clock_ns)
        moving = () if measured.velocities is None else measured.velocities
        return ControllerState(
            stamp_ns=time_ns,
            joint_names=self._parameters.joints,
            desired=TrajectoryPoint(clock_ns, position, velocity, acceleration, np.zeros(len(position))),
            actual=TrajectoryPoint(time_ns - motion.start_ns, measured.positions, moving),
            error=TrajectoryPoint(0, position - measured.positions, np.zeros(len(moving))),
            output=TrajectoryPoint(0, self.command),
            speed_scaling_factor=self._scaling,
        )

    def query(self, time_ns: int) -> TrajectoryState:
        """The trajectory that is being followed, at an absolute time [ns].

        Raises:
            ValueError: If the measured state of the last update is unknown.
        """
        motion = self._motion
        if motion is None or time_ns < motion.first_ns:
            return TrajectoryState(False, self.measured.positions, self.measured.velocities)
        time_from_start_ns = time_ns - motion.start_ns
        return TrajectoryState(time_from_start_ns < motion.curve.end_ns, *motion.curve.state(time_from_start_ns))

    def _begin(self, incoming: Trajectory | Waypoints, state: StartState, time_ns: int) -> Motion:
        start_ns = time_ns
        if isinstance(incoming, Trajectory):
            start_ns = incoming.stamp_ns or start_ns
        start = StartState(state.time_ns - start_ns, state.positions, state.velocities, state.accelerations)
        if isinstance(incoming, Trajectory):
            incoming = arrange(incoming, self._parameters.joints, self.command, start)
        curve = interpolate(incoming, start)
        self.incoming = None
        self._motion = Motion(
            curve, start_ns=start_ns, first_ns=time_ns, period_ns=self.period_ns, scaling=self._scaling
        )
        return self._motion
