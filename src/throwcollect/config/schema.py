"""Every key of the configuration with its type, unit, bounds, default and meaning.

A key is written once, here. The reference in ``docs/configuration.md`` and the JSON Schema are printed from it.
Units are part of the name: ``_s``, ``_m``, ``_kg``, ``_hz``, ``_mps2``; angles are radians.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PositiveInt
from typing_extensions import Self

from throwcollect.config.controllers import ControllersConfig
from throwcollect.config.key import Effect, Key
from throwcollect.config.motion import DynamicMovementPrimitive, MinimumJerk, MotionFile
from throwcollect.config.robot_config import AnyRobot, RobotConfig
from throwcollect.config.run import ClusterConfig, ContainersConfig, RunConfig
from throwcollect.config.scene import BALL, AnyBody, BallConfig, BodyName, FileBodyConfig, SceneConfig
from throwcollect.config.section import ContradictionError, Name, Section, any_of, unknown_joint
from throwcollect.config.sensors import Sensors
from throwcollect.config.sweep import MOST_TRIALS, Parameter, Range, SweepConfig, Values
from throwcollect.config.task_config import TaskConfig, UntilConfig
from throwcollect.config.tool_config import ToolConfig
from throwcollect.members import find_broken, load_member, names_of, usable_names
from throwcollect.wording import join_names

__all__ = [
    "FASTEST",
    "SLOWEST",
    "Config",
    "DynamicMovementPrimitive",
    "MinimumJerk",
    "Parameter",
    "Range",
    "SweepConfig",
    "Values",
]


def _make_section_type(family: str) -> Any:
    """Make the type of a key that holds the section of any member of a family; its key `name` chooses it."""
    sections = {name: load_member(family, name) for name in usable_names(family)}
    broken = find_broken(family)
    default = next(iter(sections))

    def choose(value: Any) -> Any:
        return value.get("name", default) if isinstance(value, dict) else None

    def refuse_broken(value: Any) -> Any:
        error = broken.get(name) if isinstance(name := choose(value), str) else None
        if error is not None:
            raise ContradictionError({"name": error.one_line})
        return value

    return Annotated[any_of(sections, choose), BeforeValidator(refuse_broken)]


def _make_until_type() -> Any:
    """Make the type of the key `until`, which holds the section `until` of a task; its only key chooses it."""
    sections: dict[str, type[UntilConfig]] = {}
    for name in usable_names("tasks"):
        until = load_member("tasks", name).until
        # Tasks may have the same success. The first task's section is taken, so that packages cannot replace our own.
        sections.setdefault(until.outcome(), until)
    # The first section reports unknown keys.
    default = next(iter(sections))
    return any_of(
        sections, lambda value: next((key for key in sections if isinstance(value, dict) and key in value), default)
    )


if TYPE_CHECKING:
    EngineName = str
    AnyTool = ToolConfig
    AnyTask = TaskConfig
    AnyUntil = UntilConfig
else:
    # The members are known only when the program runs, so type checkers see their common base instead.
    EngineName = Literal[names_of("engines")]
    AnyTool = _make_section_type("tools")
    AnyTask = _make_section_type("tasks")
    AnyUntil = _make_until_type()

MOTIONS, BODIES = "motions.parquet", "bodies"
"""Names in a dataset of the file of motions, and of the directory with the shapes of bodies."""
SLOWEST, FASTEST = 0.001, 1000
"""Bounds of real-time factors: with slower ones, one step of the physics sleeps for minutes or overflows the clock."""
_BETWEEN_TRIALS_S = 10
"""Simulated time between the slots of two trials: results of a trial's goals expire before the next one."""


class SimConfig(Section):
    """How the simulation computes."""

    engine: EngineName = "bullet"
    """Physics engine: `bullet` simulates contacts; so does `mujoco`, which is faster and computes throws that differ by
    some millimetres (docs/robots.md); `ballistic` is for trying things out: an arm that is always where its commands
    are, and a ball that leaves the spoon when the spoon would have to pull it. Packages may add others."""
    physics_hz: Annotated[int, Field(ge=100, le=10000)] = 500
    """Physics steps per simulated second; also the controllers' update rate."""
    solver_iterations: Annotated[int, Field(ge=1, le=1000)] = 50
    """Iterations of the contact solver per step; MuJoCo takes fewer where fewer are enough."""
    settle_s: Annotated[float, Field(ge=0, le=2), Key(swept=True)] = 0.05
    """Simulated time for which the ball settles in the spoon before a trial."""
    command_delay_s: Annotated[float, Field(ge=0, le=0.2), Key(swept=True)] = 0.0
    """Time between a controller's command and the motor acting on it."""
    real_time_factor: Annotated[Annotated[float, Field(ge=SLOWEST, le=FASTEST)] | None, Key(Effect.APPEARANCE)] = None
    """Upper bound of simulated over real time, for people who watch; null: 1 in a session (docs/serve.md), otherwise as
    fast as possible."""
    max_trial_s: Annotated[float, Field(gt=0, le=60)] = 6.0
    """Simulated time after which a trial is ended as `timeout`."""

    @property
    def slowest_factor(self) -> float:
        """The slowest real-time factor of leased trials: 1, which watchers may ask for, or a slower configured one."""
        return min(self.real_time_factor or 1.0, 1.0)


class RecordConfig(Section):
    """What is recorded, and how it is cut into files."""

    rate_hz: Annotated[int, Field(ge=10, le=10000)] = 250
    """Recorded samples per simulated second; must divide `sim.physics_hz`."""
    topics: list[Literal["joint_states", "ball/odometry", "controller_state", "tf", "clock"]] = [
        "joint_states",
        "ball/odometry",
    ]
    """Recorded topics; the first two are always needed, as throws are judged from them."""
    zstd_level: Annotated[int, Field(ge=-7, le=19), Key(Effect.ENCODING)] = -1
    """Compression level of the MCAP chunks; with -1 they are as small as with 1, and faster to write and read."""
    trials_per_shard: Annotated[PositiveInt, Key(Effect.FILES)] = 1000
    """Trials in one MCAP file; a dataset has at most 30,000 files."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        if missing := [topic for topic in ("joint_states", "ball/odometry") if topic not in self.topics]:
            yield "topics", f"should hold {' and '.join(missing)}, from which throws are judged"


class Config(Section):
    """One collection: from the robot to the dataset."""

    name: Annotated[Name, Key(Effect.PLAN)] = "throws"
    """Name of the collection and of its files: lower-case letters, digits, - and _."""
    seed: Annotated[int, Field(ge=0, lt=2**32), Key(Effect.PLAN)] = 0
    """Root of all randomness."""
    trials: Annotated[Annotated[int, Field(ge=1, le=MOST_TRIALS)] | None, Key(Effect.PLAN)] = None
    """Number of trials; with `until`, their largest number. Null takes all points of `grid` and `list`, and with
    `until` ten trials for each throw that should land."""
    until: Annotated[AnyUntil | None, Key(Effect.PLAN)] = None
    """Ends the dataset with the trial at which enough throws have landed, or when `trials` are used up."""
    robot: Annotated[AnyRobot, Key(Effect.PHYSICS)] = RobotConfig()
    """The robot."""
    tool: Annotated[AnyTool, Key(Effect.PHYSICS)] = load_member("tools", "spoon")()
    """The tool in its hand."""
    ball: Annotated[BallConfig, Key(Effect.PHYSICS, swept=True)] = BallConfig()
    """The ball; it is the object that the robot acts on, unless `object` or the task names another one."""
    object: Annotated[BodyName | None, Key(Effect.PHYSICS)] = None
    """Name of the body of `scene.bodies` that the robot acts on in place of a ball; it needs a mass. Null for the ball,
    or for the object of the task."""
    scene: Annotated[SceneConfig, Key(Effect.PHYSICS, swept=True)] = SceneConfig()
    """The rest of the world."""
    sim: Annotated[SimConfig, Key(Effect.PHYSICS)] = SimConfig()
    """How the simulation computes."""
    controllers: Annotated[ControllersConfig, Key(Effect.PHYSICS)] = ControllersConfig()
    """How the robot's controllers answer their clients."""
    task: Annotated[AnyTask, Key(Effect.TASK)] = load_member("tasks", "throw")()
    """What the robot does."""
    sweep: Annotated[SweepConfig, Key(Effect.PLAN)] = SweepConfig()
    """What varies from trial to trial."""
    record: Annotated[RecordConfig, Key(Effect.PHYSICS)] = RecordConfig()
    """What is recorded."""
    sensors: Annotated[Sensors, Key(Effect.ENCODING, swept=False)] = {}
    """Cameras and lidars that see the recorded states, by name; the name is that of topics and frames."""
    run: Annotated[RunConfig, Key(Effect.RUN, operator=True)] = RunConfig()
    """How it is run."""
    containers: Annotated[ContainersConfig, Key(Effect.RUN, operator=True)] = ContainersConfig()
    """Runs in containers."""
    cluster: Annotated[ClusterConfig, Key(Effect.RUN, operator=True)] = ClusterConfig()
    """Runs on a cluster."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        yield from self._find_unknown_joints()
        # Samples are taken at physics steps, with the same number of steps between each two.
        if self.sim.physics_hz % self.record.rate_hz:
            yield "record.rate_hz", f"should divide sim.physics_hz, {self.sim.physics_hz}, got {self.record.rate_hz}"
        if (policy := self.task.policy) is not None:
            if self.sim.physics_hz % policy.rate_hz:
                sentence = f"should divide sim.physics_hz, {self.sim.physics_hz}, got {policy.rate_hz}"
                yield "task.policy.rate_hz", sentence
            if "controller_state" in self.record.topics:
                yield "record.topics", "should not hold controller_state, as task.policy commands the joints"
        for name, sensor in self.sensors.items():
            if self.record.rate_hz % sensor.rate_hz:
                sentence = f"should divide record.rate_hz, {self.record.rate_hz}, got {sensor.rate_hz}"
                yield f"sensors.{name}.rate_hz", sentence
        if isinstance(self.robot.locked, list) and (moving := [j for j in self.robot.locked if j in self.task.end]):
            yield "robot.locked", f"should not hold joints that task.end moves, got {', '.join(moving)}"
        for joint in self.robot.joint_offsets:
            if joint not in self.task.end:
                yield f"robot.joint_offsets.{joint}", "should be left out, as task.end does not move this joint"
        for joint in self.robot.posture:
            if joint in self.task.start:
                yield f"robot.posture.{joint}", "should be left out, as task.start sets this joint"
        yield from self._find_wrong_bodies()
        for name in sorted(self.scene.bodies.keys() & {BALL, self.tool.name, self.robot.name}):
            yield f"scene.bodies.{name}", "should have another name, as the ball, the tool or the robot has this one"
        for name in self.scene.bodies.keys() & self.task.bodies.keys():
            yield f"scene.bodies.{name}", f"should have another name, as the task {self.task.name} has such a body"
        if self.until is not None and self.until.outcome() != self.task.success:
            yield f"until.{self.until.outcome()}", f"should be {self.task.success}, as the task is {self.task.name}"
        if self.sweep.target is not None and "landing" not in self.task.events:
            yield "sweep.target", f"should be left out, as the task {self.task.name} throws no ball"
        if self.until is not None and self.sweep.sampler == "list":
            yield "until", "should be left out, as the file of the sampler list is not part of the dataset"
        if self.run.root_namespace and self.run.simulations > 1:
            several = f"{self.run.simulations} simulations (-n)"
            yield "run.root_namespace", f"should be left out, as {several} cannot share a namespace"

    @property
    def bodies(self) -> dict[str, AnyBody]:
        """All bodies of the scene and of the task, by name."""
        return {**self.scene.bodies, **self.task.bodies}

    @property
    def moving_joints(self) -> tuple[str, ...]:
        """Joints that the task moves, in the order of the robot's joints."""
        return tuple(joint for joint in self.robot.find().joints if joint in self.task.end)

    @property
    def acted_on(self) -> str:
        """Name of the object that the robot acts on; it is one of `bodies`, or the ball."""
        return self.object or self.task.object or BALL

    def _find_wrong_bodies(self) -> Iterator[tuple[str, str]]:
        bodies, acted_on = self.bodies, self.acted_on
        if acted_on != BALL:
            movable = [name for name, body in bodies.items() if body.mass_kg and not isinstance(body, FileBodyConfig)]
            if acted_on not in movable:
                kind = "box, cylinder or sphere with a mass_kg"
                yield "object", f"should be a {kind}, {join_names(movable) or 'none'}, got {acted_on}"
            if self.ball != BallConfig():
                yield "ball", f"should be left out, as the robot acts on {acted_on}"
        for name, body in bodies.items():
            below = body.lies_on
            if below is None or (below == self.tool.name and name == acted_on):
                continue
            if below not in bodies or bodies[below].lies_on is not None:
                others = [other for other, each in bodies.items() if other != name and each.lies_on is None]
                yield (
                    f"scene.bodies.{name}.lies_on",
                    f"should be a body that lies on none, {join_names(others) or 'none'}, got {below}",
                )

    def _find_unknown_joints(self) -> Iterator[tuple[str, str]]:
        robot = self.robot.find()
        named = {
            "robot.posture": self.robot.posture,
            "robot.locked": self.robot.locked if isinstance(self.robot.locked, list) else (),
            "task.start": self.task.start,
            "task.end": self.task.end,
        }
        for section, joints in named.items():
            unknown = [joint for joint in joints if joint not in robot.joints]
            if unknown and section in ("task.start", "task.end") and section[5:] not in self.task.model_fields_set:
                # The user has written none of these joints: they come from the default.
                which = self.robot.name if type(self.robot) is RobotConfig else f"URDF --flange {robot.hand}"
                init = f"throwcollect init --robot {which}"
                yield section, f"missing, and the default has joints that {robot.title} lacks; `{init}` writes one"
                continue
            for joint in joints:
                if joint in unknown:
                    yield f"{section}.{joint}", unknown_joint(joint, robot)
                elif (
                    section == "task.end" and joint not in self.task.start and self.task.start.keys() <= {*robot.joints}
                ):
                    yield f"{section}.{joint}", "start should name this joint, too"

    def without_run(self) -> Self:
        """Make a copy of this configuration in which all keys that do not change the dataset have their defaults."""
        return self.with_files_in(Path()).model_copy(
            update={
                "run": RunConfig(),
                "containers": ContainersConfig(),
                "cluster": ClusterConfig(),
                "robot": self.robot.without_place(),
            }
        )

    def with_files_in(self, directory: Path) -> Self:
        """Make a copy of this configuration whose motions and bodies, if they are in files, are those of a dataset."""
        changes: dict[str, Any] = {}
        if isinstance(self.task.trajectory, MotionFile):
            place: dict[str, Any] = {"file": str(directory / MOTIONS), "joints": [], "rate_hz": None}
            motions = self.task.trajectory.model_copy(update=place)
            changes["task"] = self.task.model_copy(update={"trajectory": motions})
        bodies = {name: body for name, body in self.scene.bodies.items() if isinstance(body, FileBodyConfig)}
        if bodies:
            placed = {name: body.in_directory(directory / BODIES) for name, body in bodies.items()}
            changes["scene"] = self.scene.model_copy(update={"bodies": {**self.scene.bodies, **placed}})
        return self.model_copy(update=changes) if changes else self

    def run_as(self, other: Self) -> Self:
        """Make a copy of this configuration that takes all keys that do not change the dataset from another one."""
        return self.model_copy(update={name: getattr(other, name) for name in ("run", "containers", "cluster")})

    def trial_start_ns(self, number: int) -> int:
        """Simulated time at which a trial starts [ns]; the slots of different trials never overlap.

        Time 0 itself is left out, as it means "unset" in ROS.
        """
        slot_s = math.ceil(self.sim.max_trial_s) + _BETWEEN_TRIALS_S
        return (number + 1) * slot_s * 10**9
