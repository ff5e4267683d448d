"""Uses of parameters that the embedded backend allows and rclpy does not."""

from rclzenoh.interfaces.msg import ParameterDescriptor
from rclzenoh.parameter import Parameter


def test_a_descriptor_can_be_used_for_several_parameters(rig):
    node = rig.node("node")
    descriptor = ParameterDescriptor(description="shared")
    node.declare_parameter("group.a", 1, descriptor)
    node.declare_parameter("group.b", "x", descriptor)
    assert node.describe_parameter("group.a").name == "group.a"
    assert node.describe_parameter("group.b").type == Parameter.Type.STRING.value
