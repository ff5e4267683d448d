"""The joint trajectory controller: goals in; commands, decisions and results out."""

from __future__ import annotations

import logging
import sys
from collections.abc import Hashable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.followed_curve import Motion
from throwcollect.control.interpolation import interpolate
from throwcollect.control.parameters import ControllerParameters
from throwcollect.control.tolerances import Tolerances
from throwcollect.control.validation import find_refusal
from throwcollect.control.values import (
    ControllerState,
    ErrorCode,
    GoalResult,
    GoalStatus,
    JointState,
    Trajectory,
    TrajectoryGoal,
    TrajectoryPoint,
    TrajectoryRefusal,
    TrajectoryState,
)
from throwcollect.control.waypoints import Waypoints, arrange, brake

REPEATED = "repeated"
"""Attribute of log records that clients can cause as often as they like; its value is the subject of the record. A log
may drop some of these records. All other records are one line for each goal, stop or decision."""

_FAR_AHEAD_NS = 3600 * 10**9
"""A trajectory that starts later than this from now was most likely stamped by another clock."""

_MOST_SPEED = 1000.0
"""Largest speed of a trajectory's clock [-]. Upstream has no limit, but far above this one, the nanoseconds that the
clock advances in a period do not fit into 64 bits."""


class JointTrajectoryController:
    """Follows joint trajectories by commanding positions, as the controller of ros2_controllers (Jazzy, 4.42) does.

    The caller begins with `reset`. It then calls `update` once a control period, or, where nothing has to be decided,
    `take` for many periods at once: both leave the controller in the same state. Between updates it hands in goals. It
    fetches their results with `pop_results` after every call, because a goal is decided in the update in which upstream
    decides it.

    Args:
        name: Name of the controller, for texts.
        parameters: Its parameters; later changes must keep the joints and the interfaces that are measured.
        period_ns: Control period [ns], above 0; an update commands the positions that are due one period later.
        holds_command: Whether joints that are stopped are held at the last command, so that joints which lag under load
            do not sag. Otherwise they are held where they are measured, as upstream does.
        topic_aborts_goal: Whether a trajectory from the topic aborts the goal that is being executed. Otherwise the
            goal is judged on that trajectory, as upstream does.

    Attributes:
        command: Last commanded positions [rad], shape ``(n_joints,)``, read-only.
        goal_id: Identity of the goal that is being executed; None if there is none.
        logger: Gets one line for each refusal and each stop.
    """

    command: NDArray[np.float64]
    _motion: Motion
    _measured: JointState
    _time_ns: int

    def __init__(
        self,
        name: str,
        parameters: ControllerParameters,
        *,
        period_ns: int,
        holds_command: bool = False,
        topic_aborts_goal: bool = False,
    ) -> None:
        self.name = name
        self.logger = logging.getLogger(f"throwcollect.control.{name}")
        self._period_ns = period_ns
        self._holds_command = holds_command
        self._topic_aborts_goal = topic_aborts_goal
        self.parameters = parameters
        self._tolerances = self._defaults
        self.goal_id: Hashable | None = None
        self._results: list[GoalResult] = []
        self._scaling = 1.0
        self._incoming: Trajectory | Waypoints | None = None
        """The trajectory, or the hold, that begins with the next update; None if the present one goes on."""
        self._holding = True

    @property
    def parameters(self) -> ControllerParameters:
        """The parameters of the controller; changed tolerances hold from the next goal on."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: ControllerParameters) -> None:
        self._parameters = parameters
        self._defaults = Tolerances.of(parameters)
        if parameters.cmd_timeout and not parameters.timeout_ns:
            values = f"({parameters.cmd_timeout:g} vs. {parameters.constraints.goal_time:g})"
            problem = f"Command timeout must be higher than goal_time tolerance {values}; it is off."
            self.logger.warning("%s: %s", self.name, problem, extra={REPEATED: "timeout"})

    @property
    def at_rest(self) -> bool:
        """Whether every further command equals the last and nothing is decided, until a goal or trajectory comes."""
        if self.goal_id is not None or self._incoming is not None:
            return False
        return self._motion.past_end and self.next_decision() == sys.maxsize

    def scale_speed(self, factor: float) -> None:
        """Let the trajectory's clock go at another speed [-]: slower below 1, 0 stops it. Log wrong speeds."""
        if not 0 <= factor <= _MOST_SPEED:
            rule = "Scaling factor has to be greater or equal to 0.0 - Ignoring input!"
            problem = f"{rule} (got {factor:g}; expected 0 to {_MOST_SPEED:g})"
            self.logger.warning("%s: %s", self.name, problem, extra={REPEATED: "speed"})
        elif factor != self._scaling:
            self._scaling = factor
            self._motion.scale(factor)

    def reset(self, time_ns: int, measured: JointState) -> None:
        """Begin now [ns], or anew after a reset of the simulation: abort the goal, and hold the measured positions."""
        self._abort("simulation was reset")
        self._time_ns, self._measured, self._scaling = time_ns, measured, 1.0
        self._begin(Waypoints.single(measured.positions), measured)
        self.command = self._motion.command
        self._holding = True

    def submit(self, goal_id: Hashable, goal: TrajectoryGoal, now_ns: int) -> TrajectoryRefusal | None:
        """Accept a goal, which aborts the one before, or refuse it.

        Args:
            goal_id: Identity that its result will bear; not None.
            goal: What is asked for.
            now_ns: Current time [ns].

        Returns:
            None if the goal is accepted; otherwise the reason of the refusal, which the log has too.
        """
        if reason := self._find_refusal(goal.trajectory, now_ns):
            return reason
        self._abort("Current goal preempted by new incoming action.")
        self.goal_id = goal_id
        self._follow(goal.trajectory, self._defaults.merge(goal, logger=self.logger))
        return None

    def replace(self, trajectory: Trajectory, now_ns: int) -> TrajectoryRefusal | None:
        """Follow a trajectory from the topic instead of the present one, or refuse it as `submit` refuses a goal."""
        if reason := self._find_refusal(trajectory, now_ns):
            return reason
        if self._topic_aborts_goal:
            self._abort("Current goal preempted by a trajectory on the topic.")
        # An open goal keeps its own tolerances, which the new trajectory has to meet.
        self._follow(trajectory, self._tolerances if self.goal_id is not None else self._defaults)
        return None

    def refuse(self, reason: TrajectoryRefusal) -> TrajectoryRefusal:
        """Log a refusal that was decided elsewhere, and name the controller in it."""
        self.logger.error("%s: %s", self.name, reason.text, stacklevel=2)
        return TrajectoryRefusal(reason.error_code, f"{self.name}: {reason.text}")

    def cancel(self, goal_id: Hashable) -> bool:
        """Cancel a goal and stop, from the state that was measured last (see `observe`).

        Returns:
            Whether the goal was being executed.
        """
        if self.goal_id is None or self.goal_id != goal_id:
            return False
        self._stop()
        self._finish(GoalResult(GoalStatus.CANCELED, ErrorCode.SUCCESSFUL, ""))
        return True

    def update(self, time_ns: int, measured: JointState) -> NDArray[np.float64]:
        """Command the next control period.

        Args:
            time_ns: Time of this update, one period after the one before [ns].
            measured: State at this time.

        Returns:
            Positions to command [rad], shape ``(n_joints,)``, read-only.
        """
        self._time_ns, self._measured = time_ns, measured
        begins = self._incoming is not None
        if self._incoming is not None:
            self._begin(self._incoming, measured)
        else:
            self._motion.advance()
        decision = None if self._holding else self._decide(first=begins)
        # As upstream does: positions are written only while tolerances are met. So the last command stays until the
        # stop begins.
        if decision is None or decision.status is not GoalStatus.ABORTED:
            self.command = self._motion.command
        return self.command

    def next_decision(self) -> int:
        """Count the updates that can pass without the controller seeing the measured state.

        Returns:
            Most updates that `take` may make now; the one after them must be made with `update`. `sys.maxsize` if
            nothing is to be decided.
        """
        if self._incoming is not None:
            return 0
        if self._holding:
            return sys.maxsize
        updates = self._tolerances.updates_to_skip(self._motion, goal=self.goal_id is not None)
        return sys.maxsize if updates is None else updates

    def take(self, n_updates: int) -> NDArray[np.float64]:
        """Make many updates at once, one control period after another, that need no measured state.

        Args:
            n_updates: Number of updates, from 1 to `next_decision`.

        Returns:
            Their commands [rad], shape ``(n_updates, n_joints)``, read-only.
        """
        commands = self._motion.skip(n_updates)
        self._time_ns += n_updates * self._period_ns
        self.command = commands[-1]
        return commands

    def observe(self, measured: JointState) -> None:
        """Set the measured state at the time of the last update that `take` made.

        Call it after `take` and before `cancel`, `state` or `query`, which use the state that was measured last.
        """
        self._measured = measured

    def pop_results(self) -> tuple[GoalResult, ...]:
        """Return the results of the goals that have ended since the last call, oldest first."""
        results, self._results = tuple(self._results), []
        return results

    def state(self, time_ns: int | None = None) -> ControllerState:
        """Report the state of the last update, which is the content of feedback while a goal is being executed.

        Args:
            time_ns: Time of what was observed last, if that was after the update [ns].
        """
        motion, measured = self._motion, self._measured
        time_ns = self._time_ns if time_ns is None else time_ns
        clock_ns = motion.clock_ns + round((time_ns - self._time_ns) * self._scaling)
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
        """Evaluate the trajectory that is being followed at an absolute time [ns]."""
        motion = self._motion
        if time_ns < motion.first_ns:
            return TrajectoryState(False, self._measured.positions, self._measured.velocities)
        time_from_start_ns = time_ns - motion.start_ns
        return TrajectoryState(time_from_start_ns < motion.curve.end_ns, *motion.curve.state(time_from_start_ns))

    def _begin(self, incoming: Trajectory | Waypoints, state: JointState) -> None:
        """Follow a new trajectory or hold from the present update on, in which the joints are in the given state."""
        start_ns = self._time_ns
        if isinstance(incoming, Trajectory):
            start_ns = incoming.stamp_ns or start_ns
            incoming = arrange(incoming, self._parameters.joints, self.command, state, self._time_ns - start_ns)
        curve = interpolate(incoming, state, self._time_ns - start_ns)
        self._incoming = None
        self._motion = Motion(
            curve, start_ns=start_ns, first_ns=self._time_ns, period_ns=self._period_ns, scaling=self._scaling
        )

    def _decide(self, *, first: bool) -> GoalResult | None:
        motion = self._motion
        if (decision := self._tolerances.decide(motion, self._measured, first=first)) is None:
            return None
        if decision.status is GoalStatus.ABORTED:
            remark = "" if self.goal_id is not None else " (no goal is open; the trajectory of the topic ends)"
            self.logger.warning("%s: %s%s", self.name, decision.error_string, remark)
            self._stop()
        # An end that no goal waits for is judged again in each update until its goal time is over.
        elif self.goal_id is not None or self._tolerances.is_settled(motion):
            self._hold(Waypoints.single(*motion.curve.state(motion.curve.end_ns)))
        self._finish(decision)
        return decision

    def _follow(self, trajectory: Trajectory, tolerances: Tolerances) -> None:
        self._incoming, self._tolerances, self._holding = trajectory, tolerances, False

    def _hold(self, waypoints: Waypoints) -> None:
        self._incoming, self._holding = waypoints, True

    def _stop(self) -> None:
        measured, constraints = self._measured, self._parameters.constraints
        if measured.velocities is not None:
            hardest = np.array([constraints.of(joint).max_deceleration_on_cancel for joint in self._parameters.joints])
            self._hold(brake(measured.positions, measured.velocities, hardest, self._period_ns))
        else:
            self._hold(Waypoints.single(self.command if self._holds_command else measured.positions))

    def _abort(self, reason: str) -> None:
        """Drop the goal for a reason outside of its trajectory."""
        self._finish(GoalResult(GoalStatus.ABORTED, ErrorCode.INVALID_GOAL, reason))

    def _finish(self, result: GoalResult) -> None:
        if self.goal_id is not None:
            self._results.append(replace(result, goal_id=self.goal_id))
            self.goal_id = None

    def _find_refusal(self, trajectory: Trajectory, now_ns: int) -> TrajectoryRefusal | None:
        if reason := find_refusal(trajectory, self._parameters, now_ns):
            return self.refuse(reason)
        ahead_ns = (trajectory.stamp_ns or now_ns) - now_ns
        if ahead_ns > _FAR_AHEAD_NS:
            doubt = "was it stamped by a clock that is not the simulation's?"
            self.logger.warning("%s: the trajectory starts %.0f s from now; %s", self.name, ahead_ns / 1e9, doubt)
        return None
