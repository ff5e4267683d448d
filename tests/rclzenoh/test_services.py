"""Services and clients, through a real router."""

import threading

import numpy as np
import pytest
import zenoh

from rclzenoh.endpoint import Attachment, unpack
from rclzenoh.interfaces import deserialize, get_service, serialize, type_hash
from rclzenoh.keys import data_key

SetBool = get_service("std_srvs/srv/SetBool")


def answer(request, response):
    response.success, response.message = request.data, "done"
    return response


@pytest.fixture
def pair(rig):
    server, client = rig.node("server"), rig.node("client")
    return server, client, client.create_client(SetBool, "/server/set")


def test_a_discovered_service_answers_the_first_request(rig, pair):
    server, node, _ = pair
    for number in range(50):
        client = node.create_client(SetBool, f"/set{number}")
        thread = threading.Thread(target=server.create_service, args=(SetBool, f"/set{number}", answer))
        thread.start()
        assert client.wait_for_service(30)
        future = client.call_async(SetBool.Request(data=True))
        thread.join()
        assert rig.spin(future.done), f"the first request to {client.service_name} is lost"


def test_a_service_answers_on_the_wire_as_rmw_zenoh_does(rig, pair):
    server, node, client = pair
    server.create_service(SetBool, "~/set", answer)
    assert client.wait_for_service(30)
    key = data_key(node.context.get_domain_id(), "/server/set", SetBool.TYPE, type_hash(SetBool.TYPE))
    attachment = Attachment(7, 5, bytes(range(16))).pack()
    replies = []
    node.context.session.get(
        key,
        zenoh.handlers.Callback(replies.append, drop=lambda: replies.append(None), indirect=False),
        target=zenoh.QueryTarget.ALL_COMPLETE,
        consolidation=zenoh.ConsolidationMode.NONE,
        payload=serialize(SetBool.Request(data=True)),
        attachment=attachment,
    )
    # The query ends at once, because the server drops it.
    assert rig.spin(lambda: replies and replies[-1] is None)
    assert str(replies[0].ok.key_expr) == key
    assert replies[0].ok.payload.to_bytes() == serialize(SetBool.Response(success=True, message="done"))
    received = unpack(replies[0].ok.attachment)
    assert (received.sequence, received.gid) == (7, bytes(range(16)))


def test_garbage_is_answered_with_an_error_and_does_not_stop_the_service(rig, pair, capsys):
    server, node, client = pair
    server.create_service(SetBool, "~/set", answer)
    client.wait_for_service(30)
    key = data_key(node.context.get_domain_id(), "/server/set", SetBool.TYPE, type_hash(SetBool.TYPE))
    random = np.random.default_rng(2)
    ended = []
    for length in (0, 1, 4, 33, 60):
        node.context.session.get(
            key,
            zenoh.handlers.Callback(print, drop=lambda: ended.append(1), indirect=False),
            payload=random.bytes(length),
            attachment=random.bytes(length),
        )
    node.context.session.get(key, zenoh.handlers.Callback(print, drop=lambda: ended.append(1), indirect=False))
    assert rig.spin(lambda: len(ended) == 6)
    assert rig.result(client.call_async(SetBool.Request(data=True))).success
    assert capsys.readouterr().err.count("/server/set: ignored") == 1


def test_a_request_to_another_key_is_answered_with_an_error(rig, pair):
    server, node, client = pair
    asked = []
    server.create_service(SetBool, "~/set", lambda request, response: asked.append(request) or response)
    other = node.create_client(SetBool, "/server/other")
    client.wait_for_service(30)
    replies = []
    # A router that numbers keys as for an earlier link delivers requests to other services of the same session.
    node.context.session.get(
        data_key(node.context.get_domain_id(), "/server/set", SetBool.TYPE, type_hash(SetBool.TYPE)),
        zenoh.handlers.Callback(replies.append, drop=lambda: replies.append(None), indirect=False),
        payload=serialize(SetBool.Request()),
        encoding=other.encoding,
        attachment=Attachment(1, 0, bytes(16)).pack(),
    )
    assert rig.spin(lambda: replies and replies[-1] is None)
    assert "sent to another topic or service" in replies[0].err.payload.to_string()
    assert not asked


def test_a_response_to_another_client_is_not_taken_for_its_own(rig, pair, monkeypatch, capsys):
    server, _, client = pair
    server.create_service(SetBool, "~/set", answer)
    client.wait_for_service(30)
    monkeypatch.setattr(
        "rclzenoh.service.Attachment", lambda number, sent_at, _gid: Attachment(number, sent_at, bytes(16))
    )
    future = client.call_async(SetBool.Request())
    assert rig.spin(lambda: not client._pending)
    assert not future.done()
    assert "unexpected response" in capsys.readouterr().err


def test_an_error_in_a_callback_ends_spinning_and_the_request(rig, pair):
    server, _, client = pair

    def fail(_request, _response):
        raise LookupError("callback failed")

    server.create_service(SetBool, "~/set", fail)
    client.wait_for_service(30)
    key = data_key(server.context.get_domain_id(), "/server/set", SetBool.TYPE, type_hash(SetBool.TYPE))
    replies = []
    rig.context().session.get(
        key,
        zenoh.handlers.Callback(replies.append, drop=lambda: replies.append(None), indirect=False),
        payload=serialize(SetBool.Request()),
        attachment=Attachment(1, 0, bytes(16)).pack(),
    )
    with pytest.raises(LookupError, match="callback failed") as caught:
        rig.rest(5)
    # The query ends even while the traceback keeps its objects alive.
    assert rig.spin(lambda: replies == [None])
    assert caught.value.args == ("callback failed",)


def test_a_request_that_arrives_while_the_service_is_destroyed_gets_no_response(rig, pair, monkeypatch):
    server, node, client = pair
    service = server.create_service(SetBool, "~/set", answer)
    assert client.wait_for_service(30)

    def destroy_meanwhile(payload, kind):
        # Another thread may destroy the service just after the spinning thread has taken a request.
        server.destroy_service(service)
        return deserialize(payload, kind)

    monkeypatch.setattr("rclzenoh.service.deserialize", destroy_meanwhile)
    replies = []
    node.context.session.get(
        data_key(node.context.get_domain_id(), "/server/set", SetBool.TYPE, type_hash(SetBool.TYPE)),
        zenoh.handlers.Callback(replies.append, drop=lambda: replies.append(None), indirect=False),
        payload=serialize(SetBool.Request()),
        attachment=Attachment(1, 0, bytes(16)).pack(),
    )
    assert rig.spin(lambda: replies)
    assert replies == [None]
