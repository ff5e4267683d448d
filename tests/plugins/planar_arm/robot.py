"""An arm of two joints that swings in one plane, from behind over the top."""

from pathlib import Path
from types import MappingProxyType

from throwcollect.robots.robot import Robot

PLANAR_ARM = Robot(
    name="planar_arm",
    title="the planar arm",
    controllers=MappingProxyType({"arm_controller": ("shoulder_joint", "elbow_joint")}),
    share=lambda: Path(__file__).parent.parent,
    urdf="planar_arm/planar_arm.urdf",
    srdf="planar_arm/planar_arm.srdf",
    rest="rest",
    hand="hand_link",
    holding=("hand_link", "forearm_link"),
)
