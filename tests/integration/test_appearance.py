"""A running simulation accepts another appearance of the robot for viewers, but no other physics."""

import xml.etree.ElementTree as ElementTree

from tests.integration.robot import CONFIG, Robot
from throwcollect.robots.description import full_description
from throwcollect.ros import DurabilityPolicy, QoSProfile

LATE = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
OWN = full_description(CONFIG)


def with_hat() -> str:
    robot = ElementTree.fromstring(OWN)  # noqa: S314 - it is ours
    (head,) = (link for link in robot.findall("link") if link.get("name") == "head_2_link")
    geometry = ElementTree.SubElement(ElementTree.SubElement(head, "visual"), "geometry")
    ElementTree.SubElement(geometry, "box", size="0.1 0.1 0.5")
    return ElementTree.tostring(robot, encoding="unicode")


def test_a_changed_description_reaches_present_and_late_listeners(robot: Robot) -> None:
    hat = with_hat()
    with robot.listening("std_msgs/msg/String", "robot_description", LATE) as before:
        robot.wait_until(lambda: bool(before), "the description")
        assert before[-1].data == OWN
        assert robot.set({"robot_description": hat}).successful
        robot.wait_until(lambda: before[-1].data == hat, "the robot has a hat")
    with robot.listening("std_msgs/msg/String", "robot_description", LATE) as late:
        robot.wait_until(lambda: bool(late), "the description for one who is late")
        assert late[-1].data == hat
    assert robot.set({"robot_description": OWN}).successful


def test_a_robot_of_another_mass_is_refused(robot: Robot) -> None:
    result = robot.set({"robot_description": OWN.replace('<mass value="', '<mass value="1', 1)})
    assert not result.successful
    assert "may differ only in what is seen" in result.reason
    assert "cannot be read as robot description" in robot.set({"robot_description": "<robot"}).reason
