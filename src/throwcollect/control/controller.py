"""The joint trajectory controller: goals in; commands, decisions and results out."""

from __future__ import annotations

import logging
import sys
from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

from throwcollect.control.decision import CANCELED, Decision, Judge
from throwcollect.control.deviations import Deviations
from throwcollect.control.goal import Trajectory, TrajectoryGoal
from throwcollect.control.log import mark_repeated
from throwcollect.control.outcome import (
    ControllerState,
    GoalResult,
    GoalStatus,
    JointState,
    Refusal,
    TrajectoryState,
)
from throwcollect.control.parameters import ControllerParameters
from throwcollect.control.stopping import brake
from throwcollect.control.tolerances import Tolerances, default_tolerances, goal_tolerances
from throwcollect.control.tracker import Tracker
from throwcollect.control.validation import refusal
from throwcollect.control.waypoints import Waypoints

_FAR_AHEAD_NS = 3600 * 10**9
"""A trajectory that starts so much later was most likely stamped by another clock."""

_MOST_SPEED = 1000.0  # Upstream has no limit; far above this one, a step of the trajectory's clock fits no number.


class JointTrajectoryController:
    """Follows joint trajectories by commanding positions, as ros2_controllers' (Jazzy, 4.42) does.

    Whoever drives it calls `update` once a control period, or, where nothing has to be decided, `take` for many at
    once: both leave the controller in the same state. Between updates it is given goals, and their results are
    fetched after every call with `pop_results`: a goal is decided in the update that upstream decides it in.

    Args:
        name: Name of the controller, for texts.
        parameters: What it is set to.
        period_ns: Control period [ns]; a command is what is due one period after its update.
        deviations: Where it differs from upstream.

    Raises:
        ValueError: If the period is not above 0.
    """

    def __init__(
        self, name: str, parameters: ControllerParameters, *, period_ns: int, deviations: Deviations | None = None
    ) -> None:
        self.name = name
        self.logger = logging.getLogger(f"throwcollect.control.{name}")
        """Gets one line for each refusal and each stop."""
        self._tracker = Tracker(name, parameters, period_ns=period_ns)
        self._deviations = deviations or Deviations()
        self._adopt(parameters)
        self._judge = self._judge_with(self._defaults)
        self._goal_id: Hashable | None = None
        self._results: list[GoalResult] = []
        self._holding = True

    @property
    def parameters(self) -> ControllerParameters:
        """What the controller is set to; tolerances that are changed are those of the next goal."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: ControllerParameters) -> None:
        self._adopt(parameters)

    @property
    def goal_id(self) -> Hashable | None:
        """Identity of the goal that is being executed, if any."""
        return self._goal_id

    @property
    def at_rest(self) -> bool:
        """Whether, unless it is told something new, every further command equals the last and nothing is decided."""
        if self._goal_id is not None or self._tracker.incoming is not None:
            return False
        return self._tracker.motion.past_end and self.next_decision() == sys.maxsize

    @property
    def command(self) -> NDArray[np.float64]:
        """Last commanded positions [rad], shape ``(n_joints,)``, read-only."""
        return self._tracker.command

    @property
    def speed_scaling_factor(self) -> float:
        """Speed of the trajectory's clock [-]."""
        return self._tracker.scaling

    def scale_speed(self, factor: float) -> bool:
        """Let the trajectory's clock go at another speed [-]: slower below 1; 0 stops it.

        Returns:
            Whether it is taken over; the log says why not.
        """
        if 0 <= factor <= _MOST_SPEED:
            self._tracker.scaling = factor
            return True
        rule = "Scaling factor has to be greater or equal to 0.0 - Ignoring input!"
        problem = f"{rule} (got {factor:g}; expected 0 to {_MOST_SPEED:g})"
        self.logger.warning("%s: %s", self.name, problem, extra=mark_repeated("speed"))
        return False

    def reset(self, time_ns: int, measured: JointState) -> None:
        """Begin, or begin anew after a reset of the simulation: a goal is aborted, the measured positions are held.

        Args:
            time_ns: Time now [ns].
            measured: State now.

        Raises:
            ValueError: If the state lacks what is to be measured.
        """
        self._finish(Decision.invalid("simulation was reset"))
        self._tracker.restart(time_ns, measured)
        self._hold(Waypoints.single(self._tracker.command))

    def submit(self, goal_id: Hashable, goal: TrajectoryGoal, now_ns: int) -> Refusal | None:
        """Accept a goal, which aborts the one before, or refuse it.

        Args:
            goal_id: Identity that its result will bear; not None.
            goal: The goal.
            now_ns: Current time [ns].

        Returns:
            None if the goal is accepted; otherwise the reason of the refusal, which the log has too.
        """
        if reason := self._refusal(goal.trajectory, now_ns):
            return reason
        self._finish(Decision.invalid("Current goal preempted by new incoming action."))
        self._goal_id = goal_id
        tolerances = goal_tolerances(goal, self._defaults, self._parameters.joints, logger=self.logger)
        self._follow(goal.trajectory, self._judge_with(tolerances))
        return None

    def replace(self, trajectory: Trajectory, now_ns: int) -> Refusal | None:
        """Follow a trajectory from the topic instead of the present one, or refuse it.

        Unless `Deviations` say otherwise, a goal that is being executed stays open and is judged on it.

        Args:
            trajectory: What to follow.
            now_ns: Current time [ns].

        Returns:
            None if the trajectory is accepted; otherwise the reason of the refusal, which the log has too.
        """
        if reason := self._refusal(trajectory, now_ns):
            return reason
        if self._deviations.topic_aborts_goal:
            self._finish(Decision.invalid("Current goal preempted by a trajectory on the topic."))
        self._follow(trajectory, self._judge if self._goal_id is not None else self._judge_with(self._defaults))
        return None

    def refuse(self, reason: Refusal) -> Refusal:
        """Log a refusal that was decided elsewhere, and name the controller in it."""
        self.logger.error("%s: %s", self.name, reason.text, stacklevel=2)
        return Refusal(reason.error_code, f"{self.name}: {reason.text}")

    def cancel(self, goal_id: Hashable) -> bool:
        """Cancel a goal and stop, from the state that was measured in the last update.

        Args:
            goal_id: Identity of the goal.

        Returns:
            Whether the goal was being executed.

        Raises:
            ValueError: If the measured state is unknown, since `take` was not followed by `observe`.
        """
        if self._goal_id is None or self._goal_id != goal_id:
            return False
        self._stop()
        self._finish(CANCELED)
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
            ValueError: If the controller was not begun (`reset`), or the state lacks what is to be measured.
        """
        tracker = self._tracker
        first = tracker.advance(time_ns, period_ns, measured)
        decision = None if self._holding else self._decide(first=first)
        if decision is None or decision.status is not GoalStatus.ABORTED:
            tracker.send()
        return tracker.command

    def next_decision(self) -> int:
        """Number of updates that can pass without the controller seeing the measured state.

        Returns:
            Most updates that `take` gives now; the one after them must be made with `update`. `sys.maxsize` if
            nothing is to be decided.
        """
        if self._holding:
            return sys.maxsize
        if self._tracker.incoming is not None:
            return 0
        updates = self._judge.updates_to_skip(self._tracker.motion, goal=self._goal_id is not None)
        return sys.maxsize if updates is None else updates

    def take(self, n_updates: int) -> NDArray[np.float64]:
        """Make many updates at once, one control period after another, that need no measured state.

        Args:
            n_updates: Number of updates, at most `next_decision`.

        Returns:
            Their commands [rad], shape ``(n_updates, n_joints)``, read-only.

        Raises:
            ValueError: If one of these updates needs the measured state.
        """
        allowed = self.next_decision()
        if not 0 <= n_updates <= allowed:
            raise ValueError(f"{self.name}: cannot take {n_updates} updates; expected 0 to {allowed}")
        if n_updates == 0:
            return np.empty((0, len(self._tracker.command)))
        return self._tracker.take(n_updates)

    def observe(self, measured: JointState) -> None:
        """Tell what the last of the updates that were taken would have measured.

        `cancel`, `state` and `query` need it; an idle controller does not.

        Args:
            measured: State at the time of that update.

        Raises:
            ValueError: If the state lacks what is to be measured.
        """
        self._tracker.observe(measured)

    def pop_results(self) -> tuple[GoalResult, ...]:
        """Results of the goals that have ended since the last call, oldest first."""
        results, self._results = tuple(self._results), []
        return results

    def state(self, time_ns: int | None = None) -> ControllerState:
        """What the last update has seen and done.

        Args:
            time_ns: Time of what was observed last, if that was after the update [ns].

        Returns:
            The state; while a goal is being executed it is also the content of its feedback.

        Raises:
            ValueError: If there was no update yet, or `take` was not followed by `observe`.
        """
        return self._tracker.state(time_ns)

    def query(self, time_ns: int) -> TrajectoryState:
        """The trajectory that is being followed, at a given time.

        Args:
            time_ns: Absolute time [ns].

        Returns:
            Its state; with success if the time is between first update and end.

        Raises:
            ValueError: If `take` was not followed by `observe`.
        """
        return self._tracker.query(time_ns)

    def _decide(self, *, first: bool) -> Decision | None:
        motion = self._tracker.motion
        if (decision := self._judge.decide(motion, self._tracker.measured, first=first)) is None:
            return None
        if decision.status is GoalStatus.ABORTED:
            holds = "" if self._goal_id is not None else " (no goal is open; the trajectory of the topic ends)"
            self.logger.warning("%s: %s%s", self.name, decision.text, holds)
            self._stop()
        elif self._goal_id is not None or self._judge.settled(motion):
            self._hold(Waypoints.single(*motion.curve.state(motion.curve.end_ns)))
        self._finish(decision)
        return decision

    def _follow(self, trajectory: Trajectory, judge: Judge) -> None:
        self._tracker.incoming, self._judge, self._holding = trajectory, judge, False

    def _hold(self, waypoints: Waypoints) -> None:
        self._tracker.incoming, self._holding = waypoints, True

    def _stop(self) -> None:
        tracker, measured = self._tracker, self._tracker.measured
        if measured.velocities is not None:
            constraints = self._parameters.constraints
            hardest = np.array([constraints.of(joint).max_deceleration_on_cancel for joint in self._parameters.joints])
            self._hold(brake(measured.positions, measured.velocities, hardest, tracker.period_ns))
        else:
            self._hold(Waypoints.single(tracker.command if self._deviations.hold == "command" else measured.positions))

    def _finish(self, decision: Decision) -> None:
        if self._goal_id is not None:
            end = (decision.status, decision.error_code, decision.text, self._tracker.time_ns)
            self._results.append(GoalResult(self._goal_id, *end))
            self._goal_id = None

    def _adopt(self, parameters: ControllerParameters) -> None:
        self._parameters = parameters
        self._defaults = default_tolerances(parameters.constraints, parameters.joints)
        if parameters.cmd_timeout and not parameters.timeout:
            values = f"({parameters.cmd_timeout:g} vs. {parameters.constraints.goal_time:g})"
            problem = f"Command timeout must be higher than goal_time tolerance {values}; it is off."
            self.logger.warning("%s: %s", self.name, problem, extra=mark_repeated("timeout"))

    def _judge_with(self, tolerances: Tolerances) -> Judge:
        return Judge(tolerances, round(self._parameters.timeout * 1e9), self._parameters.joints)

    def _refusal(self, trajectory: Trajectory, now_ns: int) -> Refusal | None:
        if reason := refusal(trajectory, self._parameters, now_ns):
            return self.refuse(reason)
        ahead_ns = (trajectory.stamp_ns or now_ns) - now_ns
        if ahead_ns > _FAR_AHEAD_NS:
            doubt = "was it stamped by a clock that is not the simulation's?"
            self.logger.warning("%s: the trajectory starts %.0f s from now; %s", self.name, ahead_ns / 1e9, doubt)
        return None
