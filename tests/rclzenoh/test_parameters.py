"""Uses of parameters that the embedded backend allows and rclpy does not."""

from rclzenoh.interfaces.msg import ParameterDescriptor
from rclzenoh.interfaces.srv import GetParameters
from rclzenoh.parameter import Parameter


def test_a_descriptor_can_be_used_for_several_parameters(rig):
    node = rig.node("node")
    descriptor = ParameterDescriptor(description="shared")
    node.declare_parameter("group.a", 1, descriptor)
    node.declare_parameter("group.b", "x", descriptor)
    assert node.describe_parameter("group.a").name == "group.a"
    assert node.describe_parameter("group.b").type == Parameter.Type.STRING.value


def test_a_request_that_names_an_unknown_parameter_is_logged(rig, capfd):
    node = rig.node("node")
    client = node.create_client(GetParameters, "~/get_parameters")
    assert client.wait_for_service(30)
    assert rig.result(client.call_async(GetParameters.Request(names=["unknown"]))).values == []
    assert "[node]: parameter service: parameter 'unknown' is not declared" in capfd.readouterr().err
