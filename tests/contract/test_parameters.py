"""Parameters of a node, and the services by which others change them."""

import re
import time
from array import array

import pytest

from tests.contract.rig import ON_RCLPY, choose_words
from tests.contract.rig import exceptions as ex
from throwcollect.ros import (
    IntegerRange,
    Parameter,
    ParameterDescriptor,
    SetParametersResult,
    SingleThreadedExecutor,
    get_message,
    get_service,
    spin_some,
)

FloatingPointRange = get_message("rcl_interfaces/msg/FloatingPointRange")
SRV = "rcl_interfaces/srv"


@pytest.fixture
def node(rig):
    return rig.node("node")


def test_declaring_twice_and_using_undeclared_parameters_is_refused(node):
    node.declare_parameter("a", 1)
    with pytest.raises(
        ex.ParameterAlreadyDeclaredException,
        match=choose_words(embedded="'a' is declared already", rclpy=r"already declared: \['a'\]"),
    ):
        node.declare_parameter("a", 1)
    undeclared = choose_words(embedded="'b' is not declared", rclpy="undeclared parameter")
    with pytest.raises(ex.ParameterNotDeclaredException, match=undeclared):
        node.get_parameter("b")
    with pytest.raises(ex.ParameterNotDeclaredException, match=undeclared):
        node.set_parameters([Parameter("b", value=1)])


def test_a_parameter_has_a_type_or_is_typed_dynamically(node):
    # rclpy only warns of a declaration without a type, as that is deprecated.
    with pytest.warns(match="deprecated") if ON_RCLPY else pytest.raises(ValueError, match="dynamic_typing"):
        node.declare_parameter("no_type")
    node.declare_parameter("a", descriptor=ParameterDescriptor(dynamic_typing=True))
    assert node.set_parameters([Parameter("a", value=1), Parameter("a", value="x")])[1].successful


def plain(value):
    """Turn an array of numbers, as rclpy returns it, into a list."""
    return list(value) if isinstance(value, array) else value


@pytest.mark.parametrize("value", [True, 3, 2.5, "x", [True, False], [1, 2], [1.0], ["a"], [b"\x01", b"\xff"], None])
def test_values_survive_the_way_through_messages(value):
    parameter = Parameter("p", value=value)
    copied = Parameter.from_parameter_msg(parameter.to_parameter_msg())
    assert (copied.name, copied.type_, plain(copied.value)) == (parameter.name, parameter.type_, value)


@pytest.mark.parametrize("value", [object(), [1, "a"], {"a": 1}])
def test_values_that_parameters_cannot_have_are_refused(value):
    with pytest.raises(
        TypeError, match=choose_words(embedded="is no value of a parameter", rclpy="not .* of the allowed types")
    ):
        Parameter("p", value=value)


def test_a_value_must_be_of_the_type_that_is_given():
    with pytest.raises(ValueError, match=choose_words(embedded="not of type DOUBLE", rclpy="DOUBLE.* do not agree")):
        Parameter("p", Parameter.Type.DOUBLE, 1)


@pytest.mark.parametrize(("value", "allowed"), [(0, True), (10, True), (4, True), (5, False), (-2, False), (12, False)])
def test_integer_ranges_have_bounds_and_steps(node, value, allowed):
    descriptor = ParameterDescriptor(integer_range=[IntegerRange(from_value=0, to_value=10, step=2)])
    node.declare_parameter("a", 2, descriptor)
    result = node.set_parameters([Parameter("a", value=value)])[0]
    assert result.successful == allowed
    assert node.get_parameter("a").value == (value if allowed else 2)


@pytest.mark.parametrize(
    ("value", "allowed"),
    [(0.0, True), (1.0000001, True), (0.3, True), (0.35, False), (1.1, False), (float("nan"), False)],
)
def test_floating_point_ranges_have_bounds_and_steps(node, value, allowed):
    descriptor = ParameterDescriptor(floating_point_range=[FloatingPointRange(from_value=0.0, to_value=1.0, step=0.1)])
    node.declare_parameter("a", 0.5, descriptor)
    assert node.set_parameters([Parameter("a", value=value)])[0].successful == allowed


def test_a_default_out_of_range_is_refused(node):
    descriptor = ParameterDescriptor(integer_range=[IntegerRange(from_value=0, to_value=1)])
    with pytest.raises(ex.InvalidParameterValueException, match="out of range"):
        node.declare_parameter("a", 5, descriptor)


def test_read_only_and_static_parameters_keep_value_and_type(node):
    node.declare_parameter("fixed", 1, ParameterDescriptor(read_only=True))
    node.declare_parameter("typed", 1)
    assert "read-only" in node.set_parameters([Parameter("fixed", value=2)])[0].reason
    wrong_type = choose_words(embedded="expected INTEGER, got DOUBLE", rclpy="expected .*INTEGER.* got .*DOUBLE")
    assert re.search(wrong_type, node.set_parameters([Parameter("typed", value=2.0)])[0].reason)
    undeclared = choose_words(embedded="cannot be undeclared", rclpy="cannot be undeclared")
    assert re.search(undeclared, node.set_parameters([Parameter("typed")])[0].reason)


def test_parameters_are_set_atomically_or_not_at_all(node):
    node.declare_parameter("a", 1)
    node.declare_parameter("b", 1)
    assert not node.set_parameters_atomically([Parameter("a", value=2), Parameter("b", value="x")]).successful
    assert node.get_parameter("a").value == 1


def test_callbacks_run_before_and_after_a_parameter_is_set(node):
    node.declare_parameter("a", 1)
    node.declare_parameter("b", 1)
    asked, told = [], []

    def ask(parameters):
        asked.append([parameter.value for parameter in parameters])
        return SetParametersResult(successful=parameters[0].value < 5, reason="too large")

    node.add_on_set_parameters_callback(ask)
    node.add_post_set_parameters_callback(lambda parameters: told.append(parameters[0].value))
    assert node.set_parameters_atomically([Parameter("a", value=2), Parameter("b", value=3)]).successful
    assert node.set_parameters([Parameter("a", value=5)])[0].reason == "too large"
    assert (asked, told, node.get_parameter("a").value) == ([[2, 3], [5]], [2], 2)


def test_the_callback_that_was_added_last_runs_first(node):
    node.declare_parameter("a", 1)
    for reason in ("first", "last"):
        result = SetParametersResult(successful=False, reason=reason)
        node.add_on_set_parameters_callback(lambda _parameters, result=result: result)
    assert node.set_parameters([Parameter("a", value=2)])[0].reason == "last"


def test_names_are_listed_by_prefix_and_depth(node):
    for name in ("x", "a.b", "a.c.d"):
        node.declare_parameter(name, 1)
    own = ["use_sim_time", "start_type_description_service"] if ON_RCLPY else ["use_sim_time"]
    assert node.list_parameters([], 0).names == [*own, "x", "a.b", "a.c.d"]
    assert node.list_parameters([], 0).prefixes == ["a", "a.c"]
    assert node.list_parameters(["a"], 0).names == ["a.b", "a.c.d"]
    assert node.list_parameters(["a"], 1).names == ["a.b"]
    assert node.list_parameters([], 1).names == [*own, "x"]


class Remote:
    """Parameters of ``/node`` as another node sees them."""

    def __init__(self, rig):
        self.rig, self.node, self.events = rig, rig.node("remote"), []
        self.node.create_subscription(
            get_message("rcl_interfaces/msg/ParameterEvent"), "/parameter_events", self.hear, 100
        )

    def hear(self, event):
        if event.node == "/node":
            self.events.append(event)

    def call(self, service, **fields):
        service_type = get_service(f"{SRV}/{service}")
        snake = "".join(f"_{c.lower()}" if c.isupper() else c for c in service).strip("_")
        client = self.node.create_client(service_type, f"/node/{snake}")
        assert client.wait_for_service(30)
        return self.rig.result(client.call_async(service_type.Request(**fields)))


def test_other_nodes_read_and_change_parameters(rig, node):
    node.declare_parameter("a.gain", 1.0, ParameterDescriptor(description="gain"))
    remote = Remote(rig)
    assert remote.call("ListParameters", prefixes=["a"]).result.names == ["a.gain"]
    assert remote.call("GetParameters", names=["a.gain"]).values[0].double_value == 1.0
    assert remote.call("GetParameterTypes", names=["a.gain"]).types.tolist() == [3]
    assert remote.call("DescribeParameters", names=["a.gain"]).descriptors[0].description == "gain"
    gain, wrong = Parameter("a.gain", value=2.0).to_parameter_msg(), Parameter("a.gain", value=2).to_parameter_msg()
    results = remote.call("SetParameters", parameters=[gain, wrong]).results
    assert [result.successful for result in results] == [True, False]
    assert node.get_parameter("a.gain").value == 2.0
    assert rig.spin(lambda: remote.events)
    assert remote.events[-1].changed_parameters == [gain]
    assert not remote.call("SetParametersAtomically", parameters=[gain, wrong]).result.successful


def test_requests_with_unknown_names_and_types_are_answered(rig, node):
    remote = Remote(rig)
    assert remote.call("GetParameters", names=["use_sim_time", "absent"]).values == []
    assert remote.call("GetParameterTypes", names=["absent"]).types.tolist() == []
    assert remote.call("DescribeParameters", names=["absent"]).descriptors == []
    absent, odd = (
        Parameter("absent", value=1).to_parameter_msg(),
        Parameter("use_sim_time", value=True).to_parameter_msg(),
    )
    odd.value.type = 77
    # An unknown type ends `spin_once` of rclpy, but not `spin_some`, as the next test shows.
    wanted = [absent] if ON_RCLPY else [absent, odd]
    results = remote.call("SetParameters", parameters=wanted).results
    assert [result.successful for result in results] == [False] * len(wanted)
    assert choose_words(embedded="not declared", rclpy="undeclared") in results[0].reason


def test_a_malformed_request_does_not_end_the_node(rig):
    _, caller = rig.node("asked"), rig.node("caller")
    (executor, _), asking = rig.executors[0], SingleThreadedExecutor(context=caller.context)
    asking.add_node(caller)
    client = caller.create_client(get_service("rcl_interfaces/srv/SetParameters"), "/asked/set_parameters")
    odd = Parameter("use_sim_time", value=True).to_parameter_msg()
    odd.value.type = 77

    def ask(parameter):
        future = client.call_async(client.srv_type.Request(parameters=[parameter]))
        deadline = time.monotonic() + 2
        while not future.done() and time.monotonic() < deadline:
            spin_some(executor, 0.01)
            asking.spin_once(timeout_sec=0.01)
        return future.done() and future.result().results[0].successful

    assert rig.sees(client.service_is_ready)
    assert not ask(odd)
    assert any(ask(Parameter("use_sim_time", value=False).to_parameter_msg()) for _ in range(10))
    asking.shutdown()
