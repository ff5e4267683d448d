"""Offers the standard services of simulators, simulation_interfaces 1.5, for a `LiveSimulator`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

from throwcollect.engines.engine import BodyState
from throwcollect.errors import ConfigError, MemberError, RequestError
from throwcollect.ros import Node
from throwcollect.ros.msg import EntityFilters, EntityState, Result
from throwcollect.ros.msg import SimulatorFeatures as Features
from throwcollect.ros.srv import (
    GetEntities,
    GetEntitiesStates,
    GetEntityState,
    GetSimulationState,
    GetSimulatorFeatures,
    ResetSimulation,
    SetEntityState,
    SetSimulationState,
)
from throwcollect.sim.live import LiveSimulator, StateCode
from throwcollect.units import NS_PER_S
from throwcollect.version import __version__

Fill = Callable[[Any, Any], None]
"""Function of a request and a response that fills the response."""

_WORLD_FRAME = "world"
_LARGEST = 1e3
"""Largest coordinate [m] and speed [m/s, rad/s] that a client may give a body: its place must stay a number."""
_NORM_TOLERANCE = 1e-3

_FEATURES = (
    "ENTITY_STATE_GETTING",
    "ENTITY_STATE_SETTING",
    "SPAWNING",
    "SPAWNING_RESOURCE_STRING",
    "SPAWNABLES",
    "DELETING",
    "SIMULATION_RESET",
    "SIMULATION_RESET_SPAWNED",
    "SIMULATION_RESET_TIME",
    "SIMULATION_RESET_STATE",
    "SIMULATION_STATE_GETTING",
    "SIMULATION_STATE_SETTING",
    "SIMULATION_STATE_PAUSE",
    "STEP_SIMULATION_SINGLE",
    "STEP_SIMULATION_MULTIPLE",
    "STEP_SIMULATION_ACTION",
)
_TIME, _STATE = ResetSimulation.Request.SCOPE_TIME, ResetSimulation.Request.SCOPE_STATE
_SPAWNED = ResetSimulation.Request.SCOPE_SPAWNED
_WHOLE_SCOPES = (ResetSimulation.Request.SCOPE_DEFAULT, ResetSimulation.Request.SCOPE_ALL)


class SimulationControl:
    """Offers services under relative names, so that they stand in the simulation's namespace."""

    def __init__(self, node: Node, simulation: LiveSimulator) -> None:
        self._simulation = simulation
        self._robot = simulation.config.robot.name
        # This service has no result code, unlike all others.
        node.create_service(GetSimulatorFeatures, "get_simulator_features", self._get_features)
        offer(node, GetSimulationState, "get_simulation_state", self._get_state)
        offer(node, SetSimulationState, "set_simulation_state", self._set_state)
        offer(node, ResetSimulation, "reset_simulation", self._reset)
        offer(node, GetEntities, "get_entities", self._list)
        offer(node, GetEntitiesStates, "get_entities_states", self._list_states)
        offer(node, GetEntityState, "get_entity_state", self._get_entity_state)
        offer(node, SetEntityState, "set_entity_state", self._set_entity_state)

    def _get_features(
        self, _request: GetSimulatorFeatures.Request, response: GetSimulatorFeatures.Response
    ) -> GetSimulatorFeatures.Response:
        response.features.features = [getattr(Features, name) for name in _FEATURES]
        response.features.spawn_formats = ["urdf"]
        response.features.custom_info = (
            f"throwcollect {__version__}; what is spawned is a copy of a body of the scene, or one rigid body without "
            f"meshes, and is gone with the next trial or reset of the state; one step is one physics step of "
            f"{1.0 / self._simulation.config.sim.physics_hz:g} s; the clock runs while a trial runs"
        )
        return response

    def _get_state(self, _request: GetSimulationState.Request, response: GetSimulationState.Response) -> None:
        response.state.state = int(self._simulation.state)

    def _set_state(self, request: SetSimulationState.Request, _response: SetSimulationState.Response) -> None:
        target = request.state.state
        if target not in list(StateCode):
            raise RequestError("INCORRECT_TRANSITION", f"state {target} cannot be set")
        if target == self._simulation.state:
            raise RequestError("ALREADY_IN_TARGET_STATE", f"the simulation is {StateCode(target).name} already")
        try:
            self._simulation.set_state(StateCode(target))
        except ConfigError as error:
            raise RequestError("STATE_TRANSITION_ERROR", str(error)) from error

    def _reset(self, request: ResetSimulation.Request, _response: ResetSimulation.Response) -> None:
        self._simulation.trial.require_free()
        scope = request.scope
        if scope in _WHOLE_SCOPES:
            self._simulation.reset()
        elif scope & ~(_TIME | _STATE | _SPAWNED):
            message = f"scope {scope} cannot be reset"
            expected = f"sums of {_TIME} TIME, {_STATE} STATE, {_SPAWNED} SPAWNED; 0 or 255 for all"
            raise RequestError("RESULT_FEATURE_UNSUPPORTED", message, expected=expected)
        else:
            if scope & _SPAWNED:
                self._simulation.remove_spawned(self._simulation.spawned)
            if scope & (_TIME | _STATE):
                self._simulation.reset(time=bool(scope & _TIME), state=bool(scope & _STATE))

    def _list(self, request: GetEntities.Request, response: GetEntities.Response) -> None:
        response.entities = self._select(request.filters)

    def _list_states(self, request: GetEntitiesStates.Request, response: GetEntitiesStates.Response) -> None:
        response.entities = self._select(request.filters)
        response.states = [self._read_state(name) for name in response.entities]

    def _get_entity_state(self, request: GetEntityState.Request, response: GetEntityState.Response) -> None:
        response.state = self._read_state(request.entity)

    def _set_entity_state(self, request: SetEntityState.Request, _response: SetEntityState.Response) -> None:
        self._simulation.trial.require_free()
        self._require(request.entity)
        if request.entity not in self._simulation.world.free:
            raise RequestError("RESULT_OPERATION_FAILED", f"{request.entity} is fixed to the world")
        self._simulation.place(request.entity, read_state(request.state))

    def _select(self, filters: EntityFilters) -> list[str]:
        if filters != EntityFilters():
            message = f"entities cannot be filtered; known: {', '.join(self._names)}"
            raise RequestError("RESULT_FEATURE_UNSUPPORTED", message)
        return self._names

    @property
    def _names(self) -> list[str]:
        return [*self._simulation.world.bodies, self._robot]

    def _read_state(self, name: str) -> EntityState:
        self._require(name)
        base = BodyState((0.0, 0.0, self._simulation.config.robot.base_height_m))
        states = {self._robot: base, **self._simulation.world.bodies}
        return _to_message(states[name], self._simulation.now_ns)

    def _require(self, name: str) -> None:
        if name not in self._names:
            raise RequestError("RESULT_NOT_FOUND", f"no entity {name!r:.80}; known: {', '.join(self._names)}")


def read_state(message: EntityState) -> BodyState:
    """Read and check a state in the frame of the world."""
    if (frame := message.header.frame_id) not in ("", _WORLD_FRAME):
        raise RequestError("INVALID_POSE", f"no frame {frame!r:.80}", expected=_WORLD_FRAME)
    position, turn = message.pose.position, message.pose.orientation
    linear, angular = message.twist.linear, message.twist.angular
    state = BodyState(
        (position.x, position.y, position.z),
        (turn.x, turn.y, turn.z, turn.w),
        (linear.x, linear.y, linear.z),
        (angular.x, angular.y, angular.z),
    )
    # Each condition is written as `not ... <=`, so that it rejects NaN, too, for which no comparison holds.
    norm = math.hypot(*state.orientation_xyzw)
    if not abs(norm - 1.0) <= _NORM_TOLERANCE:
        text = f"orientation {state.orientation_xyzw}: a quaternion of norm {norm:g}"
        raise RequestError("INVALID_POSE", text, expected="norm 1")
    twist = (*state.linear_velocity, *state.angular_velocity)
    for reason, what, values in (
        ("INVALID_POSE", "position", state.position),
        ("RESULT_OPERATION_FAILED", "twist", twist),
    ):
        if not all(abs(value) <= _LARGEST for value in values):
            raise RequestError(reason, f"{what} {values}", expected=f"at most {_LARGEST:g} m, m/s and rad/s")
    return state


def _to_message(state: BodyState, now_ns: int) -> EntityState:
    """Make the message of a state in world at a time; accelerations are not measured."""
    message = EntityState()
    message.header.frame_id = _WORLD_FRAME
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(now_ns, NS_PER_S)
    position, orientation = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = state.position
    orientation.x, orientation.y, orientation.z, orientation.w = state.orientation_xyzw
    linear, angular = message.twist.linear, message.twist.angular
    linear.x, linear.y, linear.z = state.linear_velocity
    angular.x, angular.y, angular.z = state.angular_velocity
    return message


def offer(node: Node, service: Any, name: str, fill: Fill) -> None:
    """Offer a service of a node: `fill` fills the response, or raises an error, with which the service answers."""

    def answer(request: Any, response: Any) -> Any:
        response.result.result = Result.RESULT_OK
        try:
            fill(request, response)
        except RequestError as error:
            return refusal(service.Response, error)
        except (ConfigError, MemberError) as error:
            return refusal(service.Response, RequestError("RESULT_OPERATION_FAILED", str(error)))
        return response

    node.create_service(service, name, answer)


_R = TypeVar("_R")


def refusal(response_type: type[_R], error: RequestError) -> _R:
    """Make a response, or any other message with a ``result``, that gives the reason of an error.

    If the type of the message and all services have a result code of the same name, the code of the type is taken.
    """
    constants = response_type if hasattr(response_type, error.reason) else Result
    response: Any = response_type()
    response.result.result = getattr(constants, error.reason)
    response.result.error_message = str(error)
    refused: _R = response
    return refused
