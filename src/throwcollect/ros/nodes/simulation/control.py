"""Offers the standard services of simulators, simulation_interfaces 1.5, for a `LiveSimulator`."""

from __future__ import annotations

from throwcollect.errors import ConfigError, RequestError
from throwcollect.ros import Node
from throwcollect.ros.msg import SimulatorFeatures as Features
from throwcollect.ros.nodes.simulation.answers import offer
from throwcollect.ros.nodes.simulation.entities import EntityServices
from throwcollect.ros.srv import GetSimulationState, GetSimulatorFeatures, ResetSimulation, SetSimulationState
from throwcollect.sim.live import LiveSimulator, StateCode
from throwcollect.version import __version__

_FEATURES = (
    "ENTITY_STATE_GETTING",
    "ENTITY_STATE_SETTING",
    "SIMULATION_RESET",
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
_WHOLE_SCOPES = (ResetSimulation.Request.SCOPE_DEFAULT, ResetSimulation.Request.SCOPE_ALL)


class SimulationControl:
    """Offers services under relative names, so that they stand in the simulation's namespace."""

    def __init__(self, node: Node, simulation: LiveSimulator) -> None:
        self._simulation = simulation
        # This service has no result code, unlike all others.
        node.create_service(GetSimulatorFeatures, "get_simulator_features", self._get_features)
        offer(node, GetSimulationState, "get_simulation_state", self._get_state)
        offer(node, SetSimulationState, "set_simulation_state", self._set_state)
        offer(node, ResetSimulation, "reset_simulation", self._reset)
        EntityServices(node, simulation)

    def _get_features(
        self, _request: GetSimulatorFeatures.Request, response: GetSimulatorFeatures.Response
    ) -> GetSimulatorFeatures.Response:
        response.features.features = [getattr(Features, name) for name in _FEATURES]
        response.features.custom_info = (
            f"throwcollect {__version__}; one step is one physics step of "
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
        elif scope & ~(_TIME | _STATE):
            message = f"scope {scope} cannot be reset"
            expected = f"sums of {_TIME} TIME, {_STATE} STATE; 0 or 255 for all"
            raise RequestError("RESULT_FEATURE_UNSUPPORTED", message, expected=expected)
        else:
            self._simulation.reset(time=bool(scope & _TIME), state=bool(scope & _STATE))
