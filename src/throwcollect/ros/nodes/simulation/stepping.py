"""Steps through a paused simulation: by a service that answers at the end, and by an action with feedback."""

from __future__ import annotations

from typing import Any

from throwcollect.errors import RequestError
from throwcollect.ros import ActionServer, CancelResponse, Future, Node
from throwcollect.ros.action import SimulateSteps
from throwcollect.ros.msg import Result
from throwcollect.ros.nodes.simulation.control import refusal
from throwcollect.ros.srv import StepSimulation
from throwcollect.sim.live import LiveSimulator, StepRequest

_ACTION = "simulate_steps"


class Stepping:
    """Offers service and action under relative names, so that they stand in the simulation's namespace.

    Steps are taken by the loop of the simulation's process, stretch by stretch, so that other requests are answered
    meanwhile.
    """

    def __init__(self, node: Node, simulation: LiveSimulator) -> None:
        self._node = node
        self._simulation = simulation
        self._awaited: list[tuple[StepRequest, Future, Any | None]] = []
        self._reported = 0
        """Number of steps of the present request that feedback has covered."""
        node.create_service(StepSimulation, "step_simulation", self._step)
        self._server = ActionServer(
            node,
            SimulateSteps,
            _ACTION,
            execute_callback=self._execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def follow_up(self) -> None:
        """Send feedback and results to clients that wait for steps; call it after each stretch."""
        for awaited in list(self._awaited):
            request, future, handle = awaited
            if handle is not None:
                self._publish_feedback(request, handle)
                if handle.is_cancel_requested:
                    self._simulation.cancel_steps(request)
            if request.is_over:
                self._awaited.remove(awaited)
                future.set_result(None)

    async def _step(
        self, request: StepSimulation.Request, response: StepSimulation.Response
    ) -> StepSimulation.Response:
        try:
            await self._take(request.steps, None)
        except RequestError as error:
            refused: StepSimulation.Response = refusal(StepSimulation.Response, error)
            return refused
        response.result.result = Result.RESULT_OK
        return response

    async def _execute(self, handle: Any) -> SimulateSteps.Result:
        try:
            await self._take(handle.request.steps, handle)
        except RequestError as error:
            if handle.is_cancel_requested:
                handle.canceled()
            else:
                handle.abort()
            refused: SimulateSteps.Result = refusal(SimulateSteps.Result, error)
            return refused
        handle.succeed()
        result = SimulateSteps.Result()
        result.result.result = Result.RESULT_OK
        return result

    async def _take(self, steps: int, handle: Any | None) -> None:
        """Wait until steps have been taken.

        Raises:
            RequestError: If the steps, or some of them, cannot be taken.
        """
        request = self._simulation.request_steps(int(steps))
        if request.is_over:
            return
        self._reported = 0
        future = Future()
        self._awaited.append((request, future, handle))
        await future
        if request.interruption is not None:
            message = f"{request.interruption}, after {request.taken} of {request.wanted} steps"
            raise RequestError("RESULT_OPERATION_FAILED", message)

    def _publish_feedback(self, request: StepRequest, handle: Any) -> None:
        """Send feedback for every step, as the action promises, if feedback has subscribers."""
        first, self._reported = self._reported + 1, request.taken
        if self._node.count_subscribers(f"{_ACTION}/_action/feedback"):
            for completed in range(first, request.taken + 1):
                remaining = request.wanted - completed
                handle.publish_feedback(SimulateSteps.Feedback(completed_steps=completed, remaining_steps=remaining))
