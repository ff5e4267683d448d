"""The ROS 2 nodes of controllers, with the names that they have on the real robot, and the node that lists them."""

from __future__ import annotations

import logging
import math
import time

from throwcollect.control.controller import REPEATED
from throwcollect.control.values import ControllerState
from throwcollect.ros import DurabilityPolicy, Node, QoSProfile, pass_on_log, provide_time
from throwcollect.ros.msg import ControllerState as ControllerDescription
from throwcollect.ros.msg import JointTrajectory, JointTrajectoryControllerState, SpeedScalingFactor
from throwcollect.ros.nodes.controller.action import ControllerAction, nanoseconds, read_trajectory, state_message
from throwcollect.ros.nodes.controller.parameters import COMMAND_INTERFACES, ControllerParameterServer, state_interfaces
from throwcollect.ros.srv import ListControllers, QueryTrajectoryState
from throwcollect.sim.limb_controller import LimbController
from throwcollect.sim.live import LiveSimulator

_SPEED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_STATES = QoSProfile(depth=100)
"""Deep enough for all states of one stretch of time, because they leave together."""
_REPEATED_S = 1.0
_TYPE = "joint_trajectory_controller/JointTrajectoryController"


class ControllerNode(Node):
    """Offers one controller in the namespace of the simulation's node.

    Attributes:
        controller: Name of the controller in the simulation.
        parameter_server: Offers the parameters of the controller.
        action: The action by which clients give the controller goals.
    """

    def __init__(self, parent: Node, simulation: LiveSimulator, controller: str) -> None:
        limb = simulation.limbs[controller]
        super().__init__(limb.name, namespace=parent.get_namespace(), context=parent.context)
        provide_time(self)
        self.controller = controller
        self._simulation = simulation
        self._limb = limb
        self._log = _LogHandler(self)
        limb.controller.logger.addHandler(self._log)
        self.parameter_server = ControllerParameterServer(self, limb, simulation.trial)
        self.action = ControllerAction(
            self, simulation, controller, aborts_refused=simulation.config.controllers.refused_goals == "abort"
        )
        self.create_subscription(JointTrajectory, "~/joint_trajectory", self._follow, 10)
        self.create_subscription(SpeedScalingFactor, "~/speed_scaling_input", self._scale_speed, _SPEED)
        self.create_service(QueryTrajectoryState, "~/query_state", self._query)
        self._states = self.create_publisher(JointTrajectoryControllerState, "~/controller_state", _STATES)

    @property
    def watched(self) -> bool:
        """Whether the controller's state, or the feedback of a goal that was taken, has subscribers."""
        return self.wants_states or self.action.watched

    @property
    def wants_states(self) -> bool:
        """Whether the controller's state has subscribers."""
        return bool(self._states.get_subscription_count())

    def publish_state(self) -> None:
        """Publish the controller's states since the last call, and feedback on its goals, if they have subscribers."""
        states = self._limb.pop_states()
        if not self.watched:
            return
        if self.wants_states and not (states or self._simulation.running):
            # While time stands still, no state is new, but a new subscriber has not seen the present state.
            states = [self._present_state()]
        for state in states:
            self._states.publish(state_message(state))
        if self.action.owes_feedback:
            self.action.publish_feedback(self._present_state())

    def destroy_node(self) -> None:
        """Withdraw the node."""
        # Python's loggers live as long as the process, so this logger would go on to write to a node that is gone.
        self._limb.controller.logger.removeHandler(self._log)
        super().destroy_node()

    def _present_state(self) -> ControllerState:
        return self._simulation.observe(self.controller).state(self._simulation.now_ns)

    def _follow(self, message: JointTrajectory) -> None:
        self._simulation.follow(self.controller, read_trajectory(message))

    def _scale_speed(self, message: SpeedScalingFactor) -> None:
        if self._simulation.trial.leased:
            refusal = f"the speed is not scaled: {self._simulation.trial.lease_in_words}"
            self.get_logger().warning(refusal, throttle_duration_sec=_REPEATED_S)
            return
        self._limb.controller.scale_speed(message.factor)

    def _query(
        self, request: QueryTrajectoryState.Request, response: QueryTrajectoryState.Response
    ) -> QueryTrajectoryState.Response:
        state = self._simulation.observe(self.controller).query(nanoseconds(request.time))
        response.success = state.success
        response.name = list(self._limb.controller.parameters.joints)
        response.position = state.positions
        response.velocity = [] if state.velocities is None else state.velocities
        response.acceleration = [] if state.accelerations is None else state.accelerations
        return response


class _LogHandler(logging.Handler):
    """Passes a controller's log records on to the log of its node, but a repeated record at most once per second."""

    def __init__(self, node: Node) -> None:
        super().__init__()
        self._node = node
        self._passed_on_s: dict[str, float] = {}

    def emit(self, record: logging.LogRecord) -> None:
        if (about := getattr(record, REPEATED, None)) is not None:
            now_s = time.monotonic()
            if now_s < self._passed_on_s.get(about, -math.inf) + _REPEATED_S:
                return
            self._passed_on_s[about] = now_s
        pass_on_log(self._node, record)


class ControllerManager(Node):
    """Lists the controllers of a simulation, as ros2_control's controller manager does."""

    def __init__(self, parent: Node, simulation: LiveSimulator) -> None:
        super().__init__("controller_manager", namespace=parent.get_namespace(), context=parent.context)
        provide_time(self)
        hz = simulation.config.sim.physics_hz
        self._controllers = [_describe(limb, hz) for limb in simulation.limbs.values()]
        self.create_service(ListControllers, "~/list_controllers", self._list)

    def _list(self, _request: ListControllers.Request, response: ListControllers.Response) -> ListControllers.Response:
        response.controller = self._controllers
        return response


def _describe(limb: LimbController, hz: int) -> ControllerDescription:
    parameters = limb.controller.parameters
    commands, states = (
        [f"{joint}/{interface}" for joint in parameters.joints for interface in interfaces]
        for interfaces in (COMMAND_INTERFACES, state_interfaces(parameters))
    )
    return ControllerDescription(
        name=limb.name,
        state="active",
        type=_TYPE,
        update_rate=hz,
        claimed_interfaces=commands,
        required_command_interfaces=commands,
        required_state_interfaces=states,
    )
