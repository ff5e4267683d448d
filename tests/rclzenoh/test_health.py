from rclzenoh.attachment import unpack
from rclzenoh.health import REQUEST, attachment, node_answers
from rclzenoh.interfaces import serialize
from rclzenoh.interfaces.srv import GetParameters


def test_the_health_request_equals_that_of_a_client_node():
    assert serialize(GetParameters.Request()) == REQUEST
    received = unpack(attachment())
    assert received.sequence == 1
    assert attachment() != attachment()


def test_a_node_that_nobody_spins_does_not_answer(rig):
    node = rig.node("stuck")
    session, domain = node.context.session, node.context.get_domain_id()
    assert not node_answers(session, "stuck", domain_id=domain, timeout_s=0.2)
