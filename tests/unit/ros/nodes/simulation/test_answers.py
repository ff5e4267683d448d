"""Errors behind a service of simulation_interfaces are its answer, with a result code and the sentence."""

from __future__ import annotations

from typing import Any

import pytest

from throwcollect.errors import ConfigError, MemberError, RequestError
from throwcollect.ros.msg import Result
from throwcollect.ros.nodes.simulation.control import offer
from throwcollect.ros.srv import ResetSimulation


class NodeOfOneService:
    answer: Any

    def create_service(self, _type: Any, _name: str, answer: Any) -> None:
        self.answer = answer


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (RequestError("RESULT_NOT_FOUND", "no ball"), Result.RESULT_NOT_FOUND),
        (ConfigError("no ball"), Result.RESULT_OPERATION_FAILED),
        (MemberError("no ball"), Result.RESULT_OPERATION_FAILED),
    ],
)
def test_an_error_is_the_answer_of_a_service(error: Exception, code: int) -> None:
    def fail(*_: Any) -> None:
        raise error

    node: Any = NodeOfOneService()
    offer(node, ResetSimulation, "reset_simulation", fail)
    answer = node.answer(ResetSimulation.Request(), ResetSimulation.Response())
    assert (answer.result.result, answer.result.error_message) == (code, "no ball")
