import pytest

from throwcollect.config.key import Effect
from throwcollect.config.schema import Config, DynamicMovementPrimitive
from throwcollect.config.values import leaves, sweepable_keys

WEIGHTS = {joint: [0.0, 1.0] for joint in Config().task.end}
LEARNED = Config().task.model_copy(
    update={"trajectory": DynamicMovementPrimitive(family="dmp", basis_functions=2, weights=WEIGHTS)}
)
KEYS = {leaf.name: leaf for config in (Config(), Config(task=LEARNED)) for leaf in leaves(config)}


def test_every_key_says_what_it_has_an_effect_on():
    assert [name for name, leaf in KEYS.items() if leaf.key.effect is None] == []


@pytest.mark.parametrize(
    ("name", "effect"),
    [
        ("ball.mass_kg", Effect.PHYSICS),
        ("record.rate_hz", Effect.PHYSICS),
        ("record.zstd_level", Effect.ENCODING),
        ("record.trials_per_shard", Effect.FILES),
        ("sim.real_time_factor", Effect.APPEARANCE),
        ("controllers.names", Effect.APPEARANCE),
        ("controllers.hold", Effect.PHYSICS),
        ("task.start.torso_1_joint", Effect.PHYSICS),
        ("task.end.torso_1_joint", Effect.TASK),
        ("task.trajectory.weights.torso_1_joint.1", Effect.TASK),
        ("seed", Effect.PLAN),
        ("sweep.sampler", Effect.PLAN),
        ("run.ros", Effect.RUN),
    ],
)
def test_a_key_has_the_effect_of_its_section_unless_it_says_otherwise(name, effect):
    assert KEYS[name].key.effect is effect


def test_only_what_determines_samples_can_be_swept():
    swept = [leaf for leaf in KEYS.values() if leaf.key.swept]
    assert swept
    assert all(leaf.key.determines_samples for leaf in swept)


def test_keys_of_an_effect_are_a_part_of_all():
    config = Config(task=LEARNED)
    physics = sweepable_keys(config, Effect.PHYSICS)
    task = sweepable_keys(config, Effect.TASK)
    assert sorted(physics + task) == sorted(sweepable_keys(config))
    assert "ball.mass_kg" in physics
    assert "task.duration_s" in task


def test_a_value_is_told_from_its_default():
    changed = Config(task=LEARNED)
    defaults = {leaf.name: leaf.is_default for leaf in leaves(changed)}
    assert defaults["controllers.hold"]
    assert not defaults["task.trajectory.weights.torso_1_joint.1"]
