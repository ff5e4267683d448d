"""The standard services of simulation_interfaces, on top of a `Simulation`."""

from __future__ import annotations

import math
from typing import Any

import throwcollect
from throwcollect.errors import ConfigError
from throwcollect.ros import Node, get_message, get_service
from throwcollect.sim.recording import BallState
from throwcollect.sim.simulation import Simulation, State

GetSimulatorFeatures: Any = get_service("simulation_interfaces/srv/GetSimulatorFeatures")
GetSimulationState: Any = get_service("simulation_interfaces/srv/GetSimulationState")
SetSimulationState: Any = get_service("simulation_interfaces/srv/SetSimulationState")
ResetSimulation: Any = get_service("simulation_interfaces/srv/ResetSimulation")
StepSimulation: Any = get_service("simulation_interfaces/srv/StepSimulation")
GetEntityState: Any = get_service("simulation_interfaces/srv/GetEntityState")
SetEntityState: Any = get_service("simulation_interfaces/srv/SetEntityState")
Features: Any = get_message("simulation_interfaces/msg/SimulatorFeatures")
Result: Any = get_message("simulation_interfaces/msg/Result")
SimulationState: Any = get_message("simulation_interfaces/msg/SimulationState")

_FEATURES = (
    "ENTITY_STATE_GETTING",
    "ENTITY_STATE_SETTING",
    "SIMULATION_RESET",
    "SIMULATION_STATE_GETTING",
    "SIMULATION_STATE_SETTING",
    "SIMULATION_STATE_PAUSE",
    "STEP_SIMULATION_SINGLE",
    "STEP_SIMULATION_MULTIPLE",
)
_SETTABLE_STATES = (State.STOPPED, State.PLAYING, State.PAUSED, State.QUITTING)
_MOST_STEPS = 100_000
"""In one call, during which nothing else is answered: some seconds."""

_UNIT_QUATERNION_TOLERANCE = 1e-3
_LARGEST_COORDINATE_M = 1e3


class SimulationControl:
    """Offers the services under relative names, so that they stand in the simulation's namespace.

    Args:
        node: The simulation's node.
        simulation: What is controlled.
    """

    def __init__(self, node: Node, simulation: Simulation) -> None:
        self._simulation = simulation
        for service, name, callback in (
            (GetSimulatorFeatures, "get_simulator_features", self._get_features),
            (GetSimulationState, "get_simulation_state", self._get_state),
            (SetSimulationState, "set_simulation_state", self._set_state),
            (ResetSimulation, "reset_simulation", self._reset),
            (StepSimulation, "step_simulation", self._step),
            (GetEntityState, "get_entity_state", self._get_entity_state),
            (SetEntityState, "set_entity_state", self._set_entity_state),
        ):
            node.create_service(service, name, callback)

    def _get_features(self, _request: Any, response: Any) -> Any:
        response.features.features = [getattr(Features, name) for name in _FEATURES]
        response.features.custom_info = (
            f"throwcollect {throwcollect.__version__}; one step is one physics step of "
            f"{1.0 / self._simulation.config.sim.physics_hz:g} s; the clock runs while a trial runs"
        )
        return response

    def _get_state(self, _request: Any, response: Any) -> Any:
        response.state.state = int(self._simulation.state)
        response.result.result = Result.RESULT_OK
        return response

    def _set_state(self, request: Any, response: Any) -> Any:
        wanted = request.state.state
        if wanted not in _SETTABLE_STATES:
            return _refuse(response, SetSimulationState.Response.INCORRECT_TRANSITION, f"state {wanted} cannot be set")
        if wanted == self._simulation.state:
            return _refuse(
                response,
                SetSimulationState.Response.ALREADY_IN_TARGET_STATE,
                f"the simulation is {State(wanted).name} already",
            )
        try:
            self._simulation.set_state(State(wanted))
        except ConfigError as error:
            return _refuse(response, SetSimulationState.Response.STATE_TRANSITION_ERROR, str(error))
        response.result.result = Result.RESULT_OK
        return response

    def _reset(self, request: Any, response: Any) -> Any:
        if request.scope not in (ResetSimulation.Request.SCOPE_DEFAULT, ResetSimulation.Request.SCOPE_ALL):
            return _refuse(
                response,
                Result.RESULT_FEATURE_UNSUPPORTED,
                f"scope {request.scope}: only DEFAULT and ALL are supported",
            )
        try:
            self._simulation.reset()
        except ConfigError as error:
            return _refuse(response, Result.RESULT_OPERATION_FAILED, str(error))
        response.result.result = Result.RESULT_OK
        return response

    def _step(self, request: Any, response: Any) -> Any:
        if self._simulation.state != State.PAUSED:
            return _refuse(
                response, Result.RESULT_INCORRECT_STATE, "steps are taken while the simulation is paused only"
            )
        if request.steps > _MOST_STEPS:
            return _refuse(
                response, Result.RESULT_OPERATION_FAILED, f"{request.steps} steps; at most {_MOST_STEPS} in one call"
            )
        self._simulation.step(request.steps)
        response.result.result = Result.RESULT_OK
        return response

    def _get_entity_state(self, request: Any, response: Any) -> Any:
        entity = self._simulation.entity_state(request.entity)
        if entity is None:
            return _refuse(response, Result.RESULT_NOT_FOUND, self._unknown(request.entity))
        state = response.state
        state.header.frame_id = "world"
        state.header.stamp.sec, state.header.stamp.nanosec = divmod(self._simulation.now_ns, 10**9)
        position, orientation = state.pose.position, state.pose.orientation
        position.x, position.y, position.z = entity.position
        orientation.x, orientation.y, orientation.z, orientation.w = entity.orientation_xyzw
        linear, angular = state.twist.linear, state.twist.angular
        linear.x, linear.y, linear.z = entity.linear_velocity
        angular.x, angular.y, angular.z = entity.angular_velocity
        response.result.result = Result.RESULT_OK
        return response

    def _set_entity_state(self, request: Any, response: Any) -> Any:
        if self._simulation.entity_state(request.entity) is None:
            return _refuse(response, Result.RESULT_NOT_FOUND, self._unknown(request.entity))
        state = request.state
        if state.header.frame_id not in ("", "world"):
            return _refuse(
                response, Result.RESULT_OPERATION_FAILED, f"frame {state.header.frame_id}: only world is known"
            )
        position, orientation = state.pose.position, state.pose.orientation
        linear, angular = state.twist.linear, state.twist.angular
        entity = BallState(
            (position.x, position.y, position.z),
            (orientation.x, orientation.y, orientation.z, orientation.w),
            (linear.x, linear.y, linear.z),
            (angular.x, angular.y, angular.z),
        )
        norm = sum(value * value for value in entity.orientation_xyzw) ** 0.5
        outside = not all(abs(value) <= _LARGEST_COORDINATE_M for value in entity.position)
        if outside or not abs(norm - 1.0) <= _UNIT_QUATERNION_TOLERANCE:
            return _refuse(
                response,
                SetEntityState.Response.INVALID_POSE,
                f"position {entity.position} m, quaternion of norm {norm:g}; wanted within "
                f"{_LARGEST_COORDINATE_M:g} m and norm 1",
            )
        twist = (*entity.linear_velocity, *entity.angular_velocity)
        if not all(map(math.isfinite, twist)):
            return _refuse(response, Result.RESULT_OPERATION_FAILED, f"twist {twist}; wanted finite numbers")
        if not self._simulation.set_entity_state(request.entity, entity):
            return _refuse(response, Result.RESULT_OPERATION_FAILED, f"{request.entity} is fixed to the world")
        response.result.result = Result.RESULT_OK
        return response

    def _unknown(self, name: str) -> str:
        return f"no entity {name!r}; known: {', '.join(self._simulation.entities)}"


def _refuse(response: Any, code: int, message: str) -> Any:
    response.result.result = code
    response.result.error_message = message
    return response
