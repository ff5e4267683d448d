"""Every key of the configuration with its type, unit, bounds, default and meaning.

A key is written once, here. The reference in ``docs/configuration.md`` and the JSON Schema are printed from it.
Units are part of the name: ``_s``, ``_m``, ``_kg``, ``_hz``, ``_mps2``; angles are radians.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Discriminator, Field, PositiveFloat, PositiveInt, Tag, model_validator

from throwcollect.config.containers import ContainersConfig
from throwcollect.config.controllers import ControllersConfig
from throwcollect.config.kinds import Angle, ContradictionError, Joint, Name
from throwcollect.config.run import RunConfig
from throwcollect.config.section import Section
from throwcollect.config.sweep import Parameter, Range, SweepConfig, Values

__all__ = ["Config", "Parameter", "Range", "SweepConfig", "Values"]

_BETWEEN_TRIALS_S = 10
"""Simulated time between the slots of two trials: results of a trial's goals expire before the next one."""


class RobotConfig(Section):
    """The robot and how its motors follow commands."""

    name: Literal["talos"] = "talos"
    """Robot model: Talos of PAL Robotics, `talos_reduced` of example-robot-data, with its base fixed."""
    base_height_m: Annotated[float, Field(ge=0.5, le=2.0)] = 1.01927
    """Height of the fixed base link above the ground."""
    posture: dict[Joint, Angle] = {}
    """Joint angles that replace those of the half-sitting posture, for joints that the task does not move."""
    locked: Literal["auto", "none"] | list[Joint] = "auto"
    """Joints simulated as rigid: `auto` locks what the task does not move, `none` simulates all 32, or a list."""
    position_gain_per_s: Annotated[float, Field(gt=0, le=1000)] = 100.0
    """Velocity commanded per radian of position error; Bullet's position gain is this times the time step."""
    velocity_gain: Annotated[float, Field(gt=0, le=1)] = 1.0
    """Share of the velocity error that a motor removes in one step [-]."""
    effort_scale: Annotated[float, Field(gt=0, le=10)] = 1.0
    """Factor on the effort limits of all joints [-]."""


class ToolConfig(Section):
    """The throwing spoon: a handle and a cone of thin walls, fixed to the right gripper."""

    name: Literal["spoon"] = "spoon"
    """Tool model."""
    handle_length_m: Annotated[float, Field(ge=0.05, le=0.5)] = 0.15
    """Length of the handle, along -z of the gripper's base link."""
    handle_width_m: Annotated[float, Field(ge=0.004, le=0.05)] = 0.012
    """Width and thickness of the handle."""
    mount_offset_m: Annotated[float, Field(ge=0.0, le=0.3)] = 0.10
    """Distance from the gripper's base link to the handle's upper end."""
    cup_walls: Annotated[int, Field(ge=4, le=24)] = 6
    """Number of flat walls that form the cone; each costs about 5 µs a step."""
    cup_floor_radius_m: Annotated[float, Field(gt=0, le=0.05)] = 0.004
    """Radius of the cone at its bottom."""
    cup_rim_radius_m: Annotated[float, Field(gt=0, le=0.2)] = 0.045
    """Radius of the cone at its rim."""
    cup_depth_m: Annotated[float, Field(gt=0, le=0.2)] = 0.032
    """Depth of the cone."""
    wall_thickness_m: Annotated[float, Field(gt=0, le=0.02)] = 0.004
    """Thickness of the cone's walls."""
    mass_kg: Annotated[float, Field(gt=0, le=2)] = 0.12
    """Mass of the whole spoon."""

    @model_validator(mode="after")
    def _cone_opens(self) -> ToolConfig:
        if self.cup_rim_radius_m <= self.cup_floor_radius_m:
            raise ContradictionError(
                {
                    "cup_rim_radius_m": f"{self.cup_rim_radius_m} m should be above cup_floor_radius_m, "
                    f"{self.cup_floor_radius_m} m, or the cup holds no ball"
                }
            )
        return self


class BallConfig(Section):
    """The ball."""

    mass_kg: Annotated[float, Field(gt=0, le=2)] = 0.045
    """Mass."""
    radius_m: Annotated[float, Field(ge=0.005, le=0.1)] = 0.025
    """Radius."""
    friction: Annotated[float, Field(ge=0, le=2)] = 0.5
    """Coulomb friction of the ball [-]; Bullet multiplies it with that of the body it touches."""
    restitution: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Coefficient of restitution between the ball and whatever it touches [-]."""
    drag_coefficient: Annotated[float, Field(ge=0, le=2)] = 0.0
    """Drag coefficient of a sphere [-]; about 0.47 in air. Quadratic drag acts during the whole trial."""


class SceneConfig(Section):
    """The rest of the world."""

    gravity_mps2: Annotated[float, Field(gt=0, le=30)] = 9.81
    """Gravity, downwards."""
    landing_height_m: Annotated[float, Field(ge=0, le=2)] = 0.0
    """Height of the landing plane: a throw lands when the ball's lowest point crosses it, downwards."""
    air_density_kgpm3: Annotated[float, Field(ge=0, le=10)] = 1.2
    """Density of the air, for the ball's drag."""
    spoon_friction: Annotated[float, Field(ge=0, le=2)] = 0.5
    """Coulomb friction of the spoon, the robot's links and the ground [-]."""


class SimConfig(Section):
    """How the simulation computes."""

    physics_hz: Annotated[int, Field(ge=100, le=10000)] = 500
    """Physics steps per simulated second; also the controllers' update rate."""
    solver_iterations: Annotated[int, Field(ge=1, le=1000)] = 50
    """Iterations of Bullet's constraint solver per step."""
    settle_s: Annotated[float, Field(ge=0, le=2)] = 0.05
    """Simulated time for which the ball settles in the spoon before a trial."""
    command_delay_s: Annotated[float, Field(ge=0, le=0.2)] = 0.0
    """Time between a controller's command and the motor acting on it."""
    real_time_factor: Annotated[float, Field(gt=0)] | None = None
    """Upper bound of simulated over real time, for onlookers; none: as fast as it can."""
    max_trial_s: Annotated[float, Field(gt=0, le=60)] = 6.0
    """Simulated time after which a trial is ended as `timeout`."""


class MinimumJerk(Section):
    """q(t) = q0 + (q1 - q0) s((t/T)^gamma), s(x) = 10x³ - 15x⁴ + 6x⁵."""

    family: Literal["minimum_jerk"] = "minimum_jerk"
    """Trajectory family."""
    gamma: Annotated[float, Field(ge=0.67, le=3)] = 1.2
    """Time warp [-]: above 1 the speed peak comes later."""


class DynamicMovementPrimitive(Section):
    """Joint-space discrete DMP: tau z' = alpha_z (beta_z (g - y) - z) + f(x), tau y' = z, tau x' = -alpha_x x."""

    family: Literal["dmp"]
    """Trajectory family."""
    basis_functions: Annotated[int, Field(ge=2, le=500)] = 20
    """Number of Gaussian basis functions of each joint."""
    weights: dict[Joint, list[float]] = {}
    """Weights of the forcing term of each moving joint; a joint that is absent has zero weights [rad]."""
    alpha_z: PositiveFloat = 48.0
    """Stiffness constant of the transformation system [-]; beta_z is alpha_z / 4 (critically damped)."""
    alpha_x: PositiveFloat = 2.0
    """Decay constant of the phase [-]."""

    @model_validator(mode="after")
    def _weights_fit(self) -> DynamicMovementPrimitive:
        wrong = {
            f"weights.{joint}": f"should be basis_functions = {self.basis_functions} numbers, got {len(weights)}"
            for joint, weights in self.weights.items()
            if len(weights) != self.basis_functions
        }
        if wrong:
            raise ContradictionError(wrong)
        return self


def _family(value: Any) -> str | None:
    if isinstance(value, BaseModel):
        return type(value).__name__
    family = value.get("family", "minimum_jerk") if isinstance(value, dict) else None
    return {"minimum_jerk": "MinimumJerk", "dmp": "DynamicMovementPrimitive"}.get(str(family))


Trajectory = Annotated[
    Annotated[MinimumJerk, Tag("MinimumJerk")] | Annotated[DynamicMovementPrimitive, Tag("DynamicMovementPrimitive")],
    Discriminator(_family),
]


class ThrowConfig(Section):
    """The task `throw`: the arm swings from `start` to `end`; the ball leaves the spoon when the spoon brakes."""

    name: Literal["throw"] = "throw"
    """Task."""
    start: dict[Joint, Angle] = {
        "torso_1_joint": 0.0,
        "arm_right_1_joint": 1.5,
        "arm_right_2_joint": -2.6,
        "arm_right_3_joint": -1.57,
        "arm_right_4_joint": -1.9,
        "arm_right_5_joint": 0.0,
        "arm_right_6_joint": 0.0,
        "arm_right_7_joint": -0.1,
    }
    """Joint angles at the start of each trial; the spoon must hold the ball, or the trial is refused."""
    end: dict[Joint, Angle] = {
        "torso_1_joint": 0.0,
        "arm_right_1_joint": 1.5,
        "arm_right_2_joint": -2.6,
        "arm_right_4_joint": -0.5,
        "arm_right_7_joint": 0.5,
    }
    """Joint angles at the end of the motion. The joints named here are the moving ones, even if end equals start.
    One of them must move the spoon."""
    duration_s: Annotated[float, Field(ge=0.1, le=10)] = 1.0
    """Duration of the motion (tau of a DMP)."""
    trajectory: Trajectory = MinimumJerk()
    """How the joints go from start to end."""
    points_hz: Annotated[float, Field(ge=5, le=1000)] = 25.0
    """Points per second of the joint trajectories that are sent to the controllers (quintic between them)."""
    recatch_gap_s: Annotated[float, Field(ge=0, le=1)] = 0.02
    """The ball counts as released when it has been out of the spoon for this long."""

    @model_validator(mode="after")
    def _moving_joints_start_somewhere(self) -> ThrowConfig:
        wrong = {f"end.{joint}": "start should name this joint, too" for joint in self.end if joint not in self.start}
        if not self.end:
            wrong["end"] = "names no joint, so nothing would move"
        if isinstance(self.trajectory, DynamicMovementPrimitive):
            wrong |= {
                f"trajectory.weights.{joint}": "end does not name this joint, so it does not move"
                for joint in self.trajectory.weights
                if joint not in self.end
            }
        if wrong:
            raise ContradictionError(wrong)
        return self


class RecordConfig(Section):
    """What is recorded, and how it is cut into files."""

    rate_hz: Annotated[int, Field(ge=10, le=10000)] = 250
    """Recorded samples per simulated second; must divide `sim.physics_hz`."""
    topics: list[Literal["joint_states", "ball/odometry", "controller_state", "tf", "clock"]] = [
        "joint_states",
        "ball/odometry",
    ]
    """Recorded topics; the first two are always needed, as throws are judged from them."""
    zstd_level: Annotated[int, Field(ge=-7, le=19)] = -1
    """Compression level of the MCAP chunks; with -1 they are as small as with 1, and sooner written and read."""
    trials_per_shard: PositiveInt = 1000
    """Trials in one MCAP file."""

    @model_validator(mode="after")
    def _judged_topics(self) -> RecordConfig:
        if missing := [t for t in ("joint_states", "ball/odometry") if t not in self.topics]:
            raise ContradictionError({"topics": f"should hold {' and '.join(missing)}, from which throws are judged"})
        return self


class UntilConfig(Section):
    """When enough has been collected."""

    landed: Annotated[int, Field(ge=1, le=1_000_000)]
    """Throws that should land, at least; trials are added to the plan until so many have."""


class Config(Section):
    """One collection: from the robot to the dataset."""

    name: Name = "throws"
    """Name of the collection and of its files."""
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    """Root of all randomness."""
    trials: Annotated[int, Field(ge=1, le=10_000_000)] | None = None
    """Number of trials, with `until` the largest one; none means all points for `grid` and `list`, ten for each throw
    that should land with `until`."""
    until: UntilConfig | None = None
    """Collects until enough throws have landed, or `trials` are used up."""
    robot: RobotConfig = RobotConfig()
    """The robot."""
    tool: ToolConfig = ToolConfig()
    """The tool in its hand."""
    ball: BallConfig = BallConfig()
    """The ball."""
    scene: SceneConfig = SceneConfig()
    """The rest of the world."""
    sim: SimConfig = SimConfig()
    """How the simulation computes."""
    controllers: ControllersConfig = ControllersConfig()
    """How the robot's controllers answer their clients."""
    task: ThrowConfig = ThrowConfig()
    """What the robot does."""
    sweep: SweepConfig = SweepConfig()
    """What varies from trial to trial."""
    record: RecordConfig = RecordConfig()
    """What is recorded."""
    run: RunConfig = RunConfig()
    """How it is run."""
    containers: ContainersConfig = ContainersConfig()
    """Runs in containers."""

    @model_validator(mode="after")
    def _sections_agree(self) -> Config:
        wrong = {}
        if self.sim.physics_hz % self.record.rate_hz:
            wrong["record.rate_hz"] = f"should divide sim.physics_hz, {self.sim.physics_hz}, got {self.record.rate_hz}"
        if isinstance(self.robot.locked, list) and (moving := [j for j in self.robot.locked if j in self.task.end]):
            wrong["robot.locked"] = f"should not hold joints that task.end moves, got {', '.join(moving)}"
        for joint in self.robot.posture:
            if joint in self.task.start:
                wrong[f"robot.posture.{joint}"] = "should be left out, as task.start sets this joint"
        if self.until is not None and self.sweep.sampler == "list":
            wrong["until"] = "should be left out, as the file of the sampler list is not part of the dataset"
        if self.containers.sim.ports and self.run.simulations > 1:
            wrong["containers.sim.ports"] = (
                f"should be left out, as {self.run.simulations} simulations cannot share a port of this machine"
            )
        if self.run.root_namespace and self.run.simulations > 1:
            wrong["run.root_namespace"] = (
                f"should be left out, as {self.run.simulations} simulations (-n) cannot share a namespace"
            )
        if wrong:
            raise ContradictionError(wrong)
        return self

    @property
    def grows(self) -> bool:
        """Whether trials are added to the plan while it is collected."""
        return self.until is not None or self.sweep.target is not None

    def without_run(self) -> Config:
        """This configuration with all that does not change the dataset at its default."""
        return self.model_copy(update={"run": RunConfig(), "containers": ContainersConfig()})

    def trial_start_ns(self, number: int) -> int:
        """Simulated time at which a trial starts [ns]; the slots of different trials never overlap.

        Args:
            number: Number of the trial, from 0; time 0 itself is left out, as it means "unset" in ROS.
        """
        slot_s = math.ceil(self.sim.max_trial_s) + _BETWEEN_TRIALS_S
        return (number + 1) * slot_s * 10**9
