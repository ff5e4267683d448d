import pytest

from throwcollect.config.key import Effect
from throwcollect.config.motion import MotionFile
from throwcollect.config.schema import Config, DynamicMovementPrimitive
from throwcollect.config.values import leaves, list_operator_keys, sweepable_keys

WEIGHTS = {joint: [0.0, 1.0] for joint in Config().task.end}
LEARNED = Config().task.model_copy(
    update={"trajectory": DynamicMovementPrimitive(family="dmp", basis_functions=2, weights=WEIGHTS)}
)
OF_A_FILE = Config().task.model_copy(update={"trajectory": MotionFile(family="file", file="motions.csv")})
KEYS = {
    leaf.name: leaf for config in (Config(), Config(task=LEARNED), Config(task=OF_A_FILE)) for leaf in leaves(config)
}


def test_every_key_declares_its_effect():
    assert [name for name, leaf in KEYS.items() if leaf.key.effect is None] == []


@pytest.mark.parametrize(
    ("name", "effect"),
    [
        ("ball.mass_kg", Effect.PHYSICS),
        ("record.rate_hz", Effect.PHYSICS),
        ("record.zstd_level", Effect.ENCODING),
        ("record.trials_per_shard", Effect.FILES),
        ("sim.real_time_factor", Effect.APPEARANCE),
        ("controllers.hold", Effect.PHYSICS),
        ("task.start.torso_1_joint", Effect.PHYSICS),
        ("task.end.torso_1_joint", Effect.TASK),
        ("task.trajectory.weights.torso_1_joint.1", Effect.TASK),
        ("seed", Effect.PLAN),
        ("sweep.sampler", Effect.PLAN),
        ("run.ros", Effect.RUN),
    ],
)
def test_a_key_has_the_effect_of_its_section_unless_it_declares_its_own(name, effect):
    assert KEYS[name].key.effect is effect


def test_only_keys_that_determine_samples_can_be_swept():
    swept = [leaf for leaf in KEYS.values() if leaf.key.swept]
    assert swept
    assert all(leaf.key.determines_samples for leaf in swept)


def test_sweepable_keys_are_those_with_an_effect_on_physics_or_task():
    config = Config(task=LEARNED)
    physics = sweepable_keys(config, Effect.PHYSICS)
    task = sweepable_keys(config, Effect.TASK)
    assert sorted(physics + task) == sorted(sweepable_keys(config))
    assert "ball.mass_kg" in physics
    assert "task.duration_s" in task


def test_keys_that_name_files_or_resources_of_a_machine_are_operator_keys():
    assert list_operator_keys() == (
        *("robot.urdf", "robot.packages", "robot.srdf", "scene.bodies.*.file"),
        *("task.trajectory.file", "sweep.file", "run", "containers", "cluster"),
    )
