"""Binds the joint trajectory controller of one limb to those of its joints that the physics moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.controllers import ControllersConfig
from throwcollect.control.controller import JointTrajectoryController
from throwcollect.control.parameters import Constraints, ControllerParameters, JointConstraints
from throwcollect.control.values import ControllerState, ErrorCode, JointState, Trajectory, TrajectoryRefusal
from throwcollect.episode.record import ControllerSamples
from throwcollect.robots.robot import Robot

_LOCKED_TOLERANCE_RAD = 1e-6


class LimbController:
    """A controller bound to the joints of a world.

    A locked joint is always measured at its locked angle, and goals that would move it are refused.

    Args:
        robot: The robot.
        limb: Name of one of its controllers.
        moving: The world's moving joints, in order.
        period_ns: Control period [ns].
        config: How the controller answers its clients.
    """

    def __init__(
        self, robot: Robot, limb: str, *, moving: Sequence[str], period_ns: int, config: ControllersConfig
    ) -> None:
        self.name = limb
        """Name of the controller in the ROS graph."""
        joints = robot.controllers[limb]
        self._configured = _configure(robot, joints, config)
        self.controller = JointTrajectoryController(
            self.name,
            self._configured,
            period_ns=period_ns,
            holds_command=config.hold == "command",
            topic_aborts_goal=config.topic_aborts_goal,
        )
        """The controller."""
        self.watched = False
        """Whether the state of every update is kept for `pop_states`."""
        self._states: list[ControllerState] = []
        self._joints = joints
        self._own = [index for index, joint in enumerate(joints) if joint in moving]
        self._worlds = [moving.index(joints[index]) for index in self._own]
        self._posture = np.zeros(len(joints))
        self._elapsed_ns: list[int] = []
        self._points: list[NDArray[np.float64]] = []

    @property
    def is_driven(self) -> bool:
        """Whether the commands may still change, so that the limb must be driven."""
        return not self.controller.at_rest

    def reset(self, time_ns: int, posture: Mapping[str, float], *, speed: float) -> None:
        """Hold a posture; a goal that is being executed is aborted.

        Args:
            time_ns: Time now [ns].
            posture: Angle of each joint [rad].
            speed: Speed of the controller's clock [-].
        """
        self._posture = np.array([posture[joint] for joint in self._joints], dtype=float)
        self._elapsed_ns, self._points, self._states = [], [], []
        still = np.zeros(len(self._joints)) if self._configured.measures_velocity else None
        self.controller.reset(time_ns, JointState(self._posture, still))
        self.controller.scale_speed(speed)

    def restore(self) -> None:
        """Undo what clients have changed of the controller's parameters; `reset` does so with its speed."""
        if self.controller.parameters != self._configured:
            self.controller.parameters = self._configured

    def pop_states(self) -> list[ControllerState]:
        """Return the states of the updates since the last call, oldest first; there are some only if it is watched."""
        states, self._states = self._states, []
        return states

    def refuse_locked(self, trajectory: Trajectory) -> TrajectoryRefusal | None:
        """Refuse a trajectory that would move a locked joint."""
        for column, joint in enumerate(trajectory.joint_names):
            if joint not in self._joints or self._joints.index(joint) in self._own:
                continue
            held = self._posture[self._joints.index(joint)]
            if motion := _describe_motion(trajectory, column, held):
                text = f"{joint} is locked at {held:.6g} rad (robot.locked) and cannot {motion}"
                return self.controller.refuse(TrajectoryRefusal(ErrorCode.INVALID_GOAL, text))
        return None

    def measure(self, positions: Sequence[float], velocities: Sequence[float]) -> JointState:
        """Make the state of this limb's joints from positions [rad] and velocities [rad/s] of all moving joints."""
        state = self._posture.copy()
        state[self._own] = [positions[index] for index in self._worlds]
        if not self._configured.measures_velocity:
            return JointState(state)
        speeds = np.zeros(len(state))
        speeds[self._own] = [velocities[index] for index in self._worlds]
        return JointState(state, speeds)

    def update(self, time_ns: int, measured: JointState, command: NDArray[np.float64]) -> None:
        """Make one update, in which the controller sees the measured state.

        Args:
            time_ns: Time of this update [ns].
            measured: State of this limb's joints.
            command: Command of each of the world's moving joints, written in place [rad].
        """
        row = self.controller.update(time_ns, measured)
        command[self._worlds] = row[self._own]
        if self.watched:
            self._states.append(self.controller.state())

    def take(self, commands: NDArray[np.float64]) -> None:
        """Make as many updates as there are rows, without a look at the measured state.

        Args:
            commands: Commands of the world's moving joints, shape ``(n_updates, n_moving)``, written in place [rad].
        """
        commands[:, self._worlds] = self.controller.take(len(commands))[:, self._own]

    def keep_state(self) -> None:
        """Keep the controller's set points of this instant as a sample; call it right after `update`."""
        state = self.controller.state()
        desired = state.desired
        self._elapsed_ns.append(desired.time_from_start_ns)
        points = (desired.positions, desired.velocities, desired.accelerations, state.output.positions)
        self._points.append(np.stack([np.asarray(point) for point in points]))

    def collect_states(self) -> ControllerSamples:
        """Return the set points that `keep_state` has kept since the last reset."""
        table = np.array(self._points).reshape(-1, 4, len(self._joints))
        elapsed = np.array(self._elapsed_ns, dtype=np.int64)
        return ControllerSamples(elapsed, table[:, 0], table[:, 1], table[:, 2], table[:, 3])


def _describe_motion(trajectory: Trajectory, column: int, held: float) -> str:
    """Describe how a trajectory would move a joint away from the angle [rad] at which it is held; empty if it does not.

    Fields of the wrong size are not judged here, because the controller refuses them in the next check.
    """
    targets = [values[column] for values in trajectory.positions if column < len(values)]
    if away := [target for target in targets if not abs(target - held) <= _LOCKED_TOLERANCE_RAD]:
        return f"go to {away[0]:.6g} rad"
    if len(targets) == len(trajectory.positions):
        return ""
    # A point without positions is reached by its velocities and accelerations.
    points = zip(trajectory.positions, trajectory.velocities, trajectory.accelerations, strict=True)
    rates = [values for positions, *rates in points if not len(positions) for values in rates]
    return "move" if any(values[column] != 0 for values in rates if column < len(values)) else ""


def _configure(robot: Robot, joints: tuple[str, ...], config: ControllersConfig) -> ControllerParameters:
    """Make the parameters of a controller from those of the robot, and from how the configuration has joints stopped.

    With ``hold: decelerate``, joints brake by their measured velocities, which the real Talos does not have.
    """
    brakes = config.hold == "decelerate"
    deceleration = config.max_deceleration_radps2 if brakes else 0.0
    limits = JointConstraints(goal=robot.goal_tolerance_rad, max_deceleration_on_cancel=deceleration)
    return ControllerParameters(
        joints=joints,
        constraints=Constraints(
            goal_time=robot.goal_time_s,
            stopped_velocity_tolerance=robot.stopped_velocity_radps,
            decelerate_on_cancel=brakes,
            joints=dict.fromkeys(joints, limits),
        ),
    )
