"""Services and clients."""

import pytest

from tests.contract.rig import ON_RCLPY, InvalidHandle, choose_words
from throwcollect.ros import Future, get_service

Trigger = get_service("std_srvs/srv/Trigger")
SetBool = get_service("std_srvs/srv/SetBool")


def answer(request, response):
    response.success, response.message = request.data, "done"
    return response


@pytest.fixture
def pair(rig):
    server, client = rig.node("server"), rig.node("client")
    return server, client, client.create_client(SetBool, "/server/set")


def test_a_service_answers_a_request(rig, pair):
    server, _, client = pair
    assert not client.wait_for_service(timeout_sec=0.05)
    server.create_service(SetBool, "~/set", answer)
    assert client.wait_for_service(timeout_sec=30)
    assert rig.result(client.call_async(SetBool.Request(data=True))) == SetBool.Response(success=True, message="done")


def test_many_requests_at_once_get_their_own_answers(rig, pair):
    server, _, client = pair
    server.create_service(SetBool, "~/set", answer)
    client.wait_for_service(30)
    # Ten requests are as many as the queue of the service holds.
    futures = [client.call_async(SetBool.Request(data=bool(i % 3))) for i in range(10)]
    assert [rig.result(future).success for future in futures] == [bool(i % 3) for i in range(10)]


def test_a_waiting_coroutine_callback_blocks_others_only_on_rclpy(rig, pair):
    server, _, client = pair
    gate, order = Future(), []

    async def wait(request, response):
        if request.data:
            await gate
        order.append(request.data)
        return response

    server.create_service(SetBool, "~/set", wait)
    client.wait_for_service(30)
    slow, fast = (client.call_async(SetBool.Request(data=data)) for data in (True, False))
    if ON_RCLPY:
        # On rclpy, it blocks: both callbacks are in the node's group, which runs one at a time.
        rig.rest(0.3)
        assert not fast.done()
    else:
        rig.result(fast)
    assert not slow.done()
    gate.set_result(None)
    rig.result(slow)
    rig.result(fast)
    assert order == ([True, False] if ON_RCLPY else [False, True])


def test_a_service_may_call_another_service_in_a_coroutine(rig, pair):
    server, other, client = pair
    other.create_service(Trigger, "/inner", lambda _, response: response)
    inner = server.create_client(Trigger, "/inner")

    async def relay(_, response):
        response.success = (await inner.call_async(Trigger.Request())) == Trigger.Response()
        return response

    server.create_service(SetBool, "~/set", relay)
    assert client.wait_for_service(30)
    assert inner.wait_for_service(30)
    answer = client.call_async(SetBool.Request())
    if ON_RCLPY:
        # The answer is never taken: its callback is in the same group as the service that waits for it.
        rig.rest(0.3)
        assert not answer.done()
    else:
        assert rig.result(answer).success


def test_an_error_in_a_callback_ends_spinning(rig, pair):
    server, _, client = pair

    def fail(_request, _response):
        raise LookupError("callback failed")

    server.create_service(SetBool, "~/set", fail)
    client.wait_for_service(30)
    client.call_async(SetBool.Request())
    with pytest.raises(LookupError, match="callback failed"):
        rig.rest(5)


def test_a_callback_that_returns_no_response_is_a_type_error(rig, pair):
    server, _, client = pair
    server.create_service(SetBool, "~/set", lambda _request, _response: None)
    client.wait_for_service(30)
    client.call_async(SetBool.Request())
    with pytest.raises(
        TypeError, match=choose_words(embedded="must return std_srvs/srv/SetBool.Response, got None", rclpy="^$")
    ):
        rig.rest(5)


def test_a_request_of_another_type_is_not_sent(rig, pair):
    with pytest.raises(TypeError, match=choose_words(embedded="expected std_srvs/srv/SetBool.Request", rclpy="^$")):
        pair[2].call_async(Trigger.Request())


def test_a_destroyed_client_sends_nothing(rig, pair):
    _, node, client = pair
    node.destroy_client(client)
    with pytest.raises(InvalidHandle, match=choose_words(embedded="destroyed", rclpy="destruction was requested")):
        client.call_async(SetBool.Request())


def test_clients_do_not_find_a_destroyed_service(rig, pair):
    server, _, client = pair
    service = server.create_service(SetBool, "~/set", answer)
    assert client.wait_for_service(30)
    server.destroy_service(service)
    assert rig.spin(lambda: not client.service_is_ready())
