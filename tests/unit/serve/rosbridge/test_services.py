"""Services that a client calls and offers."""

from __future__ import annotations

from typing import Any

import pytest
from tests.unit.serve.rosbridge.conftest import Party, wait_for

from throwcollect.ros import Future, Node, get_service

SetBool: Any = get_service("std_srvs/srv/SetBool")


def switch(request: Any, response: Any) -> Any:
    response.success, response.message = request.data, "switched"
    return response


@pytest.fixture
def lamp(node: Node, party: Party) -> Any:
    service = node.create_service(SetBool, "/lamp", switch)
    wait_for(lambda: "/lamp" in party.call("rosapi/services")["services"])
    return service


def test_a_service_of_a_node_is_called(party: Party, lamp: Any) -> None:
    party.ask(op="call_service", id="c", service="lamp", args={"data": True})
    assert party.next(id="c") == {
        "op": "service_response",
        "id": "c",
        "service": "lamp",
        "values": {"success": True, "message": "switched"},
        "result": True,
    }


@pytest.mark.parametrize(
    ("service", "arguments"),
    [
        ("get_parameters", {"names": ["x", "trial.leases"]}),
        ("set_parameters", {"parameters": [{"name": "trial.leases"}]}),
        ("set_parameters_atomically", {"parameters": [{"name": "x"}, {"name": "trial.leases"}]}),
    ],
)
def test_a_client_can_neither_read_nor_set_leases(party: Party, node: Node, service: str, arguments: Any) -> None:
    name = f"{node.get_fully_qualified_name()}/{service}"
    wait_for(lambda: name in party.call("rosapi/services")["services"])
    party.ask(op="call_service", id="c", service=name, args=arguments)
    answer = party.next(op="service_response", id="c")
    assert answer["result"] is False
    assert "trial.leases: only the coordinator may have this parameter" in answer["values"]


def test_a_call_fails_after_its_timeout_or_when_its_service_disappears(party: Party, node: Node) -> None:
    async def wait(_request: Any, _response: Any) -> Any:
        return await Future()

    service = node.create_service(SetBool, "/slow", wait)
    wait_for(lambda: "/slow" in party.call("rosapi/services")["services"])
    party.ask(op="call_service", id=1, service="/slow", timeout=0.05)
    party.ask(op="call_service", id=2, service="/slow")
    assert party.next(id=1)["values"] == "/slow: no answer within 0.05 s"
    node.destroy_service(service)
    assert party.next(id=2)["values"] == "/slow: it has gone without an answer"
