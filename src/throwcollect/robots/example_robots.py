"""Arms that example-robot-data describes; their controllers have the names of their makers' ROS 2 drivers."""

from __future__ import annotations

from throwcollect.config.robot_config import DescribedRobotConfig, LimitsConfig

PANDA = DescribedRobotConfig(
    name="panda",
    urdf="example-robot-data:panda_description/urdf/panda.urdf",
    flange="panda_link8",
    # moveit_resources_panda_moveit_config, and Franka's own franka_bringup for its example controllers.
    controllers={"panda_arm_controller": [f"panda_joint{number}" for number in range(1, 8)]},
)
UR5 = DescribedRobotConfig(
    name="ur5",
    urdf="example-robot-data:ur_description/urdf/ur5_robot.urdf",
    flange="tool0",
    # ur_robot_driver, config/ur_controllers.yaml.
    controllers={
        "scaled_joint_trajectory_controller": [
            *("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"),
            *("wrist_1_joint", "wrist_2_joint", "wrist_3_joint"),
        ]
    },
)
XARM7 = DescribedRobotConfig(
    name="xarm7",
    urdf="example-robot-data:xarm_description/urdf/xarm7.urdf",
    flange="link_eef",
    # xarm_ros2, xarm_controller/config/xarm7_controllers.yaml.
    controllers={"xarm7_traj_controller": [f"joint{number}" for number in range(1, 8)]},
)
TIAGO = DescribedRobotConfig(
    name="tiago",
    urdf="example-robot-data:tiago_description/robots/tiago_no_hand.urdf",
    flange="arm_tool_link",
    # The root of the description is on the ground.
    base_height_m=0.0,
    # tiago_controller_configuration of tiago_robot.
    controllers={
        "torso_controller": ["torso_lift_joint"],
        "arm_controller": [f"arm_{number}_joint" for number in range(1, 8)],
        "head_controller": ["head_1_joint", "head_2_joint"],
    },
)
SO101 = DescribedRobotConfig(
    name="so101",
    urdf="example-robot-data:so_arm_description/urdf/so101.urdf",
    flange="gripper_frame_link",
    # Drivers of SO-101 for ros2_control name the controller of the five joints so; LeRobot has the names of the joints.
    controllers={"arm_controller": ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]},
    # The limits of the URDF are place-holders of 10 rad/s and 10 Nm. The servo STS3215 with a gear of 1:345 turns at 45
    # rpm without a load, and holds 19.5 kg cm at 7.4 V (data sheet of Feetech; measured: SO-ARM100, issue 134).
    limits={
        joint: LimitsConfig(max_velocity=4.7, max_effort=1.9)
        for joint in ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
    },
)
