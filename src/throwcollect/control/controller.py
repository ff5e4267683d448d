"""The joint trajectory controller: goals in; commands, decisions and results out."""

from __future__ import annotations

import logging
import sys
from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.decision import Decision, decided
from throwcollect.control.goal import Trajectory, TrajectoryGoal, TrajectoryPoint
from throwcollect.control.interpolation import Waypoints, arranged, interpolated
from throwcollect.control.motion import Motion
from throwcollect.control.outcome import ControllerState, ErrorCode, GoalResult, GoalStatus, JointState, TrajectoryState
from throwcollect.control.parameters import ControllerParameters
from throwcollect.control.tolerances import default_tolerances, goal_tolerances
from throwcollect.control.validation import refusal

_LOGGER = logging.getLogger(__name__)


class JointTrajectoryController:
    """Follows joint trajectories by commanding positions, as ros2_controllers' (Jazzy, 4.42) does.

    Whoever drives it calls `update` once a control period, or, where nothing has to be decided, `take` for many at
    once: both leave the controller in the same state. Between updates it is given goals, and their results are
    fetched after every call with `pop_results`: a goal is decided in the update that upstream decides it in.

    Args:
        name: Name of the controller, for texts.
        parameters: What it is set to.
        period_ns: Control period [ns]; a command is what is due one period after its update.

    Raises:
        ValueError: If the period is not above 0.
    """

    def __init__(self, name: str, parameters: ControllerParameters, *, period_ns: int) -> None:
        if period_ns <= 0:
            raise ValueError(f"{name}: period_ns must be above 0, got {period_ns}")
        self.name = name
        self.period_ns = period_ns
        self._parameters = parameters
        self._defaults = default_tolerances(parameters.constraints, parameters.joints)
        self._tolerances = self._defaults
        self._active = False
        self._goal_id: Hashable | None = None
        self._results: list[GoalResult] = []
        self._incoming: Trajectory | Waypoints | None = None
        self._motion: Motion | None = None
        self._holding = True
        self._time_ns = 0
        self._measured: JointState | None = None
        self._measures_velocity = "velocity" in parameters.state_interfaces
        self._command = np.zeros(len(parameters.joints))

    @property
    def parameters(self) -> ControllerParameters:
        """What the controller is set to; tolerances that are changed are those of the next goal."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: ControllerParameters) -> None:
        self._parameters.check_change(parameters, self.name)
        self._parameters = parameters
        self._defaults = default_tolerances(parameters.constraints, parameters.joints)

    @property
    def active(self) -> bool:
        """Whether the controller commands the joints."""
        return self._active

    @property
    def goal_id(self) -> Hashable | None:
        """Identity of the goal that is being executed, if any."""
        return self._goal_id

    @property
    def at_rest(self) -> bool:
        """Whether, unless it is told something new, every further command equals the last and nothing is decided."""
        idle = self._goal_id is None and self._incoming is None
        return idle and (self._holding or (self._followed().past_end and self.next_decision() == sys.maxsize))

    @property
    def command(self) -> NDArray[np.float64]:
        """Last commanded positions [rad], shape ``(n_joints,)``, read-only."""
        return self._command

    def activate(self, time_ns: int, measured: JointState, command: NDArray[np.float64] | None = None) -> None:
        """Start to command the joints, holding them where they are.

        Args:
            time_ns: Current time [ns].
            measured: Current state.
            command: Positions that the joints are commanded already [rad], shape ``(n_joints,)``; unless a parameter
                says otherwise they are held rather than the measured ones, if all are finite.

        Raises:
            ValueError: If the controller is active already, or the state lacks what the interfaces promise.
        """
        if self._active:
            raise ValueError(f"{self.name}: cannot be activated, it is active")
        take_command = self._parameters.set_last_command_interface_value_as_state_on_activation
        if command is not None and take_command and np.isfinite(command).all():
            measured = JointState(np.array(command, dtype=float), measured.velocities)
        self._restart(time_ns, measured)
        self._active = True

    def deactivate(self) -> None:
        """Stop to command the joints; a goal is aborted, the last command stays.

        Raises:
            ValueError: If the controller is not active.
        """
        self._require_active()
        self._finish(_invalid("Current goal cancelled during deactivate transition."))
        self._active = False
        self._incoming = self._motion = None

    def reset(self, time_ns: int, measured: JointState) -> None:
        """Continue from a simulation that was reset: a goal is aborted, the measured positions are held.

        Args:
            time_ns: Time after the reset [ns].
            measured: State after the reset.

        Raises:
            ValueError: If the controller is not active, or the state lacks what the interfaces promise.
        """
        self._require_active()
        self._finish(_invalid("simulation was reset"))
        self._restart(time_ns, measured)

    def submit(self, goal_id: Hashable, goal: TrajectoryGoal, now_ns: int) -> str | None:
        """Accept a goal, which aborts the one before, or refuse it.

        Args:
            goal_id: Identity that its result will bear; not None.
            goal: The goal.
            now_ns: Current time [ns].

        Returns:
            None if the goal is accepted; otherwise the reason of the refusal, which the log has too.
        """
        if text := self._refusal(goal.trajectory, now_ns, "action goals"):
            return text
        self._finish(_invalid("Current goal preempted by new incoming action."))
        self._goal_id = goal_id
        self._tolerances = goal_tolerances(goal, self._defaults, self._parameters.joints, self.name)
        self._incoming, self._holding = goal.trajectory, False
        return None

    def replace(self, trajectory: Trajectory, now_ns: int) -> str | None:
        """Follow a trajectory from the topic instead of the present one, or refuse it.

        A goal that is being executed stays open and is judged on the new trajectory, with its own tolerances.

        Args:
            trajectory: What to follow.
            now_ns: Current time [ns].

        Returns:
            None if the trajectory is accepted; otherwise the reason of the refusal, which the log has too.
        """
        if text := self._refusal(trajectory, now_ns, "trajectories"):
            return text
        if self._goal_id is None:
            self._tolerances = self._defaults
        self._incoming, self._holding = trajectory, False
        return None

    def cancel(self, goal_id: Hashable) -> bool:
        """Cancel a goal and hold the positions measured in the last update.

        Args:
            goal_id: Identity of the goal.

        Returns:
            Whether the goal was being executed.

        Raises:
            ValueError: If the measured state is unknown, since `take` was not followed by `observe`.
        """
        if self._goal_id is None or self._goal_id != goal_id:
            return False
        self._hold(Waypoints.single(self._known_state().positions))
        self._finish(Decision(GoalStatus.CANCELED, ErrorCode.SUCCESSFUL, ""))
        return True

    def update(self, time_ns: int, period_ns: int, measured: JointState) -> NDArray[np.float64]:
        """Command the next control period.

        Args:
            time_ns: Time of this update [ns].
            period_ns: Time since the update before, by which the trajectory's clock advances [ns].
            measured: State at this time.

        Returns:
            Positions to command [rad], shape ``(n_joints,)``, read-only.

        Raises:
            ValueError: If the controller is not active, or the state lacks what the interfaces promise.
        """
        self._require_active()
        self.observe(measured)
        measured, incoming = self._known_state(), self._incoming
        self._time_ns = time_ns
        if incoming is not None:
            motion = self._begin(incoming, time_ns, measured)
        else:
            motion = self._followed()
            motion.advance(period_ns)
        decision = None if self._holding else self._decided(motion, measured, first=incoming is not None)
        if decision is None or decision.status is not GoalStatus.ABORTED:
            self._command = motion.command
        return self._command

    def next_decision(self) -> int:
        """Number of updates that can pass without the controller seeing the measured state.

        Returns:
            Most updates that `take` gives now; the one after them must be made with `update`. `sys.maxsize` if
            nothing is to be decided.

        Raises:
            ValueError: If the controller is not active.
        """
        self._require_active()
        if self._holding:
            return sys.maxsize
        if self._incoming is not None:
            return 0
        motion, tolerances = self._followed(), self._tolerances
        if tolerances.checks_path and not motion.past_end:
            return 0
        if self._goal_id is not None:
            return max(0, motion.updates_until_end())
        if tolerances.checks_goal and tolerances.goal_time_ns:
            return max(0, motion.updates_until_late(tolerances.goal_time_ns))
        return sys.maxsize

    def take(self, n_updates: int) -> NDArray[np.float64]:
        """Make many updates at once, one control period after another, that need no measured state.

        Args:
            n_updates: Number of updates, at most `next_decision`.

        Returns:
            Their commands [rad], shape ``(n_updates, n_joints)``, read-only.

        Raises:
            ValueError: If the controller is not active, or one of these updates needs the measured state.
        """
        allowed = self.next_decision()
        if not 0 <= n_updates <= allowed:
            raise ValueError(f"{self.name}: cannot take {n_updates} updates; expected 0 to {allowed}")
        if n_updates == 0:
            return np.empty((0, len(self._command)))
        if self._incoming is None:
            commands = self._followed().skip(n_updates)
        else:
            # Only a hold can be waiting here, and that does not depend on the measured state.
            motion = self._begin(self._incoming, self._time_ns + self.period_ns, JointState(self._command))
            motion.skip(n_updates - 1)
            commands = np.broadcast_to(motion.command, (n_updates, len(self._command)))
        self._time_ns += n_updates * self.period_ns
        self._measured = None
        self._command = commands[-1]
        return commands

    def observe(self, measured: JointState) -> None:
        """Tell what the last of the updates that were taken would have measured.

        `cancel`, `state` and `query` need it; an idle controller does not.

        Args:
            measured: State at the time of that update.

        Raises:
            ValueError: If the state lacks what the interfaces promise.
        """
        fields = [measured.positions, measured.velocities] if self._measures_velocity else [measured.positions]
        copies = [np.array(field, dtype=float) for field in fields]
        for values in copies:
            if values.shape != self._command.shape:
                raise ValueError(f"{self.name}: measured shape {values.shape}; expected {self._command.shape}")
            values.setflags(write=False)
        self._measured = JointState(*copies)

    def pop_results(self) -> tuple[GoalResult, ...]:
        """Results of the goals that have ended since the last call, oldest first."""
        results, self._results = tuple(self._results), []
        return results

    def state(self) -> ControllerState:
        """What the last update has seen and done.

        Returns:
            The state; while a goal is being executed it is also the content of its feedback.

        Raises:
            ValueError: If there was no update yet, or `take` was not followed by `observe`.
        """
        motion, measured = self._followed(), self._known_state()
        position, velocity, acceleration = motion.curve.state(motion.clock_ns)
        moving = () if measured.velocities is None else measured.velocities
        return ControllerState(
            stamp_ns=self._time_ns,
            joint_names=self._parameters.joints,
            desired=TrajectoryPoint(motion.clock_ns, position, velocity, acceleration, np.zeros_like(position)),
            actual=TrajectoryPoint(self._time_ns - motion.start_ns, measured.positions, moving),
            error=TrajectoryPoint(0, position - measured.positions, np.zeros(len(moving))),
            output=TrajectoryPoint(0, self._command),
        )

    def query(self, time_ns: int) -> TrajectoryState:
        """The trajectory that is being followed, at a given time.

        Args:
            time_ns: Absolute time [ns].

        Returns:
            Its state; with success if the controller is active and the time is between first update and end.

        Raises:
            ValueError: If `take` was not followed by `observe`.
        """
        if not self._active:
            return TrajectoryState(False, np.empty(0))
        motion = self._motion
        if motion is None or time_ns < motion.first_ns:
            return TrajectoryState(False, self._known_state().positions, self._known_state().velocities)
        time_from_start_ns = time_ns - motion.start_ns
        return TrajectoryState(time_from_start_ns < motion.curve.end_ns, *motion.curve.state(time_from_start_ns))

    def _begin(self, incoming: Trajectory | Waypoints, time_ns: int, measured: JointState) -> Motion:
        start_ns, waypoints = time_ns, incoming
        if isinstance(waypoints, Trajectory):
            start_ns = waypoints.stamp_ns or time_ns
            waypoints = arranged(waypoints, self._parameters.joints, self._command)
        splines = self._parameters.interpolation_method == "splines"
        curve = interpolated(waypoints, time_ns - start_ns, measured.positions, measured.velocities, splines=splines)
        self._incoming = None
        self._motion = Motion(curve, start_ns=start_ns, first_ns=time_ns, period_ns=self.period_ns)
        return self._motion

    def _decided(self, motion: Motion, measured: JointState, *, first: bool) -> Decision | None:
        decision = decided(motion, measured.positions, self._tolerances, self._parameters.joints, first=first)
        if decision is None:
            return None
        if decision.status is GoalStatus.ABORTED:
            _LOGGER.warning("%s: %s", self.name, decision.text)
            self._hold(Waypoints.single(measured.positions))
        elif self._goal_id is not None:
            self._hold(Waypoints.single(*motion.curve.state(motion.curve.end_ns)))
        self._finish(decision)
        return decision

    def _hold(self, waypoint: Waypoints) -> None:
        self._incoming, self._holding = waypoint, True

    def _finish(self, decision: Decision) -> None:
        if self._goal_id is not None:
            result = GoalResult(self._goal_id, decision.status, decision.error_code, decision.text, self._time_ns)
            self._results.append(result)
            self._goal_id = None

    def _restart(self, time_ns: int, measured: JointState) -> None:
        self.observe(measured)
        self._time_ns, self._motion = time_ns, None
        self._command = self._known_state().positions
        self._hold(Waypoints.single(self._command))

    def _refusal(self, trajectory: Trajectory, now_ns: int, what: str) -> str | None:
        inactive = None if self._active else f"Can't accept new {what}. Controller is not running."
        reason = inactive or refusal(trajectory, self._parameters, now_ns)
        if reason is None:
            return None
        _LOGGER.error("%s: %s", self.name, reason)
        return f"{self.name}: {reason}"

    def _require_active(self) -> None:
        if not self._active:
            raise ValueError(f"{self.name}: the controller is not active")

    def _followed(self) -> Motion:
        if self._motion is None:
            raise ValueError(f"{self.name}: there was no update yet")
        return self._motion

    def _known_state(self) -> JointState:
        if self._measured is None:
            raise ValueError(f"{self.name}: the measured state is unknown; call observe after take")
        return self._measured


def _invalid(text: str) -> Decision:
    return Decision(GoalStatus.ABORTED, ErrorCode.INVALID_GOAL, text)
