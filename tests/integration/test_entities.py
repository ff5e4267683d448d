"""Services about entities: their names, states, bounds and infos."""

from typing import Any

import pytest

from tests.integration.robot import PAUSED, Result, Robot
from throwcollect.ros import get_message, get_service

SetEntityState: Any = get_service("simulation_interfaces/srv/SetEntityState")
EntityState: Any = get_message("simulation_interfaces/msg/EntityState")
EntityFilters: Any = get_message("simulation_interfaces/msg/EntityFilters")
EntityCategory: Any = get_message("simulation_interfaces/msg/EntityCategory")
EntityInfo: Any = get_message("simulation_interfaces/msg/EntityInfo")
TagsFilter: Any = get_message("simulation_interfaces/msg/TagsFilter")
Bounds: Any = get_message("simulation_interfaces/msg/Bounds")
Vector3: Any = get_message("geometry_msgs/msg/Vector3")


def entity_state(*, z: float = 1.0, vx: float = 0.0, w: float = 1.0, frame: str = "world") -> Any:
    state = EntityState()
    state.header.frame_id = frame
    state.pose.position.x, state.pose.position.z = 2.0, z
    state.pose.orientation.w = w
    state.twist.linear.x = vx
    return state


def test_an_unknown_entity_is_an_error_that_lists_the_known_ones(robot: Robot) -> None:
    for result in (
        robot.call("get_entity_state", entity="table").result,
        robot.call("set_entity_state", entity="table", state=entity_state()).result,
    ):
        assert result.result == Result.RESULT_NOT_FOUND
        assert result.error_message == "no entity 'table'; known: ball, talos"


def test_the_ball_lies_in_the_spoon_and_the_robot_stands_on_its_base(robot: Robot) -> None:
    ball = robot.call("get_entity_state", entity="ball").state
    assert ball.header.frame_id == "world"
    assert 0.5 < ball.pose.position.z < 2.0
    talos = robot.call("get_entity_state", entity="talos").state
    assert talos.pose.position.z == 1.01927
    assert talos.pose.orientation.w == 1.0


def test_a_placed_ball_flies_on_from_its_new_position(robot: Robot) -> None:
    robot.put_into(PAUSED)
    placed = robot.call("set_entity_state", entity="ball", state=entity_state(z=1.5, vx=1.0))
    assert placed.result.result == Result.RESULT_OK
    there = robot.call("get_entity_state", entity="ball").state
    assert (there.pose.position.x, there.pose.position.z, there.twist.linear.x) == (2.0, 1.5, 1.0)
    robot.step(100)
    flown = robot.call("get_entity_state", entity="ball").state
    assert flown.pose.position.x == pytest.approx(2.2, abs=1e-3)
    assert flown.pose.position.z == pytest.approx(1.5 - 9.81 * 0.2**2 / 2, abs=5e-3)
    assert flown.twist.linear.z == pytest.approx(-9.81 * 0.2, abs=1e-2)


@pytest.mark.parametrize(
    ("state", "code", "words"),
    [
        (entity_state(w=0.0), SetEntityState.Response.INVALID_POSE, "quaternion of norm 0"),
        (entity_state(w=0.9), SetEntityState.Response.INVALID_POSE, "quaternion of norm 0.9"),
        (entity_state(w=float("nan")), SetEntityState.Response.INVALID_POSE, "quaternion of norm nan"),
        (entity_state(z=float("nan")), SetEntityState.Response.INVALID_POSE, "nan"),
        (entity_state(z=1e9), SetEntityState.Response.INVALID_POSE, "within 1000 m of the world's origin"),
        (entity_state(vx=float("inf")), Result.RESULT_OPERATION_FAILED, "inf"),
        (entity_state(vx=1e300), Result.RESULT_OPERATION_FAILED, "up to 1000 m/s"),
        (entity_state(frame="base_link"), SetEntityState.Response.INVALID_POSE, "no frame 'base_link'"),
    ],
)
def test_a_state_without_meaning_is_refused_and_leaves_the_ball(
    state: Any, code: int, words: str, robot: Robot
) -> None:
    before = robot.call("get_entity_state", entity="ball").state
    refused = robot.call("set_entity_state", entity="ball", state=state).result
    assert refused.result == code
    assert words in refused.error_message
    assert robot.call("get_entity_state", entity="ball").state == before


def test_the_state_of_the_fixed_robot_cannot_be_set(robot: Robot) -> None:
    refused = robot.call("set_entity_state", entity="talos", state=entity_state()).result
    assert refused.result == Result.RESULT_OPERATION_FAILED
    assert refused.error_message == "talos is fixed to the world"


def bounds(kind: int, *points: tuple[float, float, float]) -> Any:
    return Bounds(type=kind, points=[Vector3(x=x, y=y, z=z) for x, y, z in points])


def find_entities(robot: Robot, **filters: Any) -> list[str]:
    response = robot.call("get_entities", filters=EntityFilters(**filters))
    assert response.result.result == Result.RESULT_OK, response.result.error_message
    return list(response.entities)


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("", ["ball", "talos"]),
        ("^talos$", ["talos"]),
        ("al", ["ball", "talos"]),
        ("^(b|t)al{1,2}$|nothing", ["ball"]),
        ("[[:digit:]]", []),
        ("^[b-t]a[^[:upper:]]{1,3}$", ["ball", "talos"]),
        (r"ball\.", []),
    ],
)
def test_entities_are_found_by_extended_regular_expressions(pattern: str, names: list[str], robot: Robot) -> None:
    assert find_entities(robot, filter=pattern) == names


@pytest.mark.parametrize(
    ("pattern", "words"),
    [
        ("(", "missing )"),
        ("*", "no argument for repetition operator: *"),
        ("a{1,255}{1,255}{1,255}", "invalid repetition size"),
        ("a" * 10_000, "10000 characters; at most 256"),
        ("\\w", "invalid escape sequence: \\w"),
    ],
)
def test_malformed_expressions_are_refused_with_the_reason(pattern: str, words: str, robot: Robot) -> None:
    refused = robot.call("get_entities", filters=EntityFilters(filter=pattern))
    assert refused.result.result == Result.RESULT_OPERATION_FAILED
    assert words in refused.result.error_message
    assert list(refused.entities) == []


def test_an_expression_with_endless_backtracking_elsewhere_is_answered(robot: Robot) -> None:
    assert find_entities(robot, filter="^(([a-z])+.)+[A-Z]([a-z])+$") == []


def test_entities_are_found_by_category(robot: Robot) -> None:
    robots, moving, humans = (
        [EntityCategory(category=category)]
        for category in (
            EntityCategory.CATEGORY_ROBOT,
            EntityCategory.CATEGORY_DYNAMIC_OBJECT,
            EntityCategory.CATEGORY_HUMAN,
        )
    )
    assert find_entities(robot, categories=robots) == ["talos"]
    assert find_entities(robot, categories=robots + moving) == ["ball", "talos"]
    assert find_entities(robot, categories=humans) == []
    assert find_entities(robot, categories=robots, filter="ball") == []


def test_the_info_of_an_entity_can_be_changed_until_a_full_reset(robot: Robot) -> None:
    before = robot.call("get_entity_info", entity="ball").info
    assert before.category.category == EntityCategory.CATEGORY_DYNAMIC_OBJECT
    info = EntityInfo(description="a tennis ball", tags=["round", "soft"])
    info.category.category = EntityCategory.CATEGORY_OBJECT
    assert robot.call("set_entity_info", entity="ball", info=info).result.result == Result.RESULT_OK
    assert robot.call("get_entity_info", entity="ball").info == info
    any_tag, all_tags = TagsFilter.FILTER_MODE_ANY, TagsFilter.FILTER_MODE_ALL
    assert find_entities(robot, tags=TagsFilter(tags=["soft", "square"], filter_mode=any_tag)) == ["ball"]
    assert find_entities(robot, tags=TagsFilter(tags=["soft", "square"], filter_mode=all_tags)) == []
    assert find_entities(robot, tags=TagsFilter(tags=["soft", "round"], filter_mode=all_tags)) == ["ball"]
    robot.reset()
    assert robot.call("get_entity_info", entity="ball").info == before


def test_invalid_tag_filters_categories_and_descriptions_are_refused(robot: Robot) -> None:
    refused = robot.call("get_entities", filters=EntityFilters(tags=TagsFilter(tags=["a"], filter_mode=7))).result
    assert (refused.result, refused.error_message) == (Result.RESULT_OPERATION_FAILED, "no tags filter mode 7")
    info = EntityInfo()
    info.category.category = 3
    refused = robot.call("set_entity_info", entity="ball", info=info).result
    assert refused.result == Result.RESULT_OPERATION_FAILED
    assert refused.error_message.startswith("no category 3")
    refused = robot.call("set_entity_info", entity="ball", info=EntityInfo(description="x" * 10**6)).result
    assert refused.result == Result.RESULT_OPERATION_FAILED
    assert "1000000 characters" in refused.error_message


def test_entities_are_found_by_place(robot: Robot) -> None:
    ball = robot.call("get_entity_state", entity="ball").state.pose.position
    x, y, z = ball.x, ball.y, ball.z
    near = bounds(Bounds.TYPE_SPHERE, (x, y, z), (0.01, 0.0, 0.0))
    far = bounds(Bounds.TYPE_SPHERE, (x + 3, y, z), (1.0, 0.0, 0.0))
    feet = bounds(Bounds.TYPE_BOX, (1.0, 1.0, 0.1), (-1.0, -1.0, 0.0))
    assert "ball" in find_entities(robot, bounds=near)
    assert find_entities(robot, bounds=far) == []
    assert find_entities(robot, bounds=feet) == ["talos"]
    beside = bounds(Bounds.TYPE_SPHERE, (x, y, z + 0.1), (0.07, 0.0, 0.0))
    assert find_entities(robot, bounds=beside, filter="ball") == []


@pytest.mark.parametrize(
    ("region", "code", "words"),
    [
        (bounds(2, (0, 0, 0), (1, 0, 0), (0, 1, 0)), Result.RESULT_FEATURE_UNSUPPORTED, "boxes and spheres"),
        (bounds(99), Result.RESULT_FEATURE_UNSUPPORTED, "type 99"),
        (bounds(1, (0, 0, 0)), Result.RESULT_OPERATION_FAILED, "1 points"),
        (bounds(1, (0, 0, 0), (1, 1, 1)), Result.RESULT_OPERATION_FAILED, "is not above"),
        (bounds(1, (float("nan"), 0, 0), (-1, -1, -1)), Result.RESULT_OPERATION_FAILED, "is not above"),
        (bounds(3, (0, 0, 0), (float("nan"), 0, 0)), Result.RESULT_OPERATION_FAILED, "radius nan"),
    ],
)
def test_invalid_bounds_are_refused(region: Any, code: int, words: str, robot: Robot) -> None:
    refused = robot.call("get_entities_states", filters=EntityFilters(bounds=region)).result
    assert refused.result == code
    assert words in refused.error_message


def test_get_entities_states_returns_the_state_of_each_entity(robot: Robot) -> None:
    response = robot.call("get_entities_states")
    assert list(response.entities) == ["ball", "talos"]
    for name, state in zip(response.entities, response.states, strict=True):
        assert robot.call("get_entity_state", entity=name).state == state


def test_bounds_enclose_an_entity_in_its_own_frame(robot: Robot) -> None:
    ball = robot.call("get_entity_bounds", entity="ball").bounds
    assert ball.type == Bounds.TYPE_BOX
    upper, lower = ball.points
    assert (upper.x, upper.y, upper.z) == pytest.approx((0.025,) * 3, abs=1e-6)
    assert (lower.x, lower.y, lower.z) == pytest.approx((-0.025,) * 3, abs=1e-6)
    upper, lower = robot.call("get_entity_bounds", entity="talos").bounds.points
    # The base of the robot is a metre above the ground.
    assert lower.z == pytest.approx(-1.02, abs=0.03)
    assert 0.6 < upper.z < 1.2


def test_a_long_unknown_name_is_not_found_and_shortened_in_the_message(robot: Robot) -> None:
    for service in ("get_entity_info", "get_entity_bounds", "delete_entity", "set_entity_info", "get_entity_state"):
        refused = robot.call(service, entity="x" * 10**6).result
        assert refused.result == Result.RESULT_NOT_FOUND, service
        assert len(refused.error_message) < 200


def test_ball_and_robot_cannot_be_deleted(robot: Robot) -> None:
    for name in ("ball", "talos"):
        refused = robot.call("delete_entity", entity=name).result
        assert refused.result == Result.RESULT_OPERATION_FAILED
        assert refused.error_message == f"{name} is part of every trial and cannot be deleted"
    assert find_entities(robot) == ["ball", "talos"]


def test_a_state_may_be_given_in_the_frame_of_another_entity(robot: Robot) -> None:
    robot.put_into(PAUSED)
    state = entity_state(z=0.5, vx=1.0, frame="talos")
    assert robot.call("set_entity_state", entity="ball", state=state).result.result == Result.RESULT_OK
    there = robot.call("get_entity_state", entity="ball").state
    assert there.header.frame_id == "world"
    assert (there.pose.position.x, there.pose.position.z) == pytest.approx((2.0, 1.51927))
    assert there.twist.linear.x == 1.0
