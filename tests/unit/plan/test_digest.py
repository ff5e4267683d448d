import hashlib
import json

import numpy as np
import pytest

from throwcollect.config.controllers import ControllersConfig
from throwcollect.config.run import ClusterConfig, ContainersConfig, NodeContainerConfig, RunConfig
from throwcollect.config.schema import Config, Range, SweepConfig
from throwcollect.config.sweep import TargetConfig
from throwcollect.config.values import values_by_key, with_values
from throwcollect.plan.digest import config_digest, trial_digests
from throwcollect.plan.trials import Points
from throwcollect.tasks.throw.throw_config import UntilLanded

WITHOUT_EFFECT = {
    *("name", "trials", "until", "sim.real_time_factor"),
    *("record.zstd_level", "record.trials_per_shard"),
}
POINTS = Points(("ball.mass_kg", "task.duration_s"), np.array([[0.1, 1.0], [0.2, 1.0]]))

TARGET = TargetConfig.model_validate({"distance_m": {"min": 1, "max": 2, "bins": 4}})


def digests(config: Config, points: Points = POINTS, seeds: tuple[int, ...] = (5, 6)) -> list[str]:
    return [digest.tobytes().hex() for digest in trial_digests(config, points, seeds)]


def test_digests_are_sha_256_over_the_effective_keys_in_order():
    kept = values_by_key(with_values(Config(), {"ball.mass_kg": 0.1, "task.duration_s": 1.0})) | {"seed": 5}
    for key in list(kept):
        outside = key.startswith(("sweep", "run.", "containers.", "cluster.", "sensors"))
        if outside or key in WITHOUT_EFFECT:
            del kept[key]
    text = "\n".join(["throwcollect trial 1", *(f"{key}={json.dumps(kept[key])}" for key in sorted(kept))])
    assert digests(Config())[0] == hashlib.sha256(text.encode()).hexdigest()


def test_a_swept_and_a_fixed_value_give_the_same_digest():
    fixed = with_values(Config(), {"ball.mass_kg": 0.2, "task.duration_s": 1.0})
    no_points = Points((), np.empty((1, 0)))
    assert digests(fixed, no_points, (6,)) == digests(Config())[1:]


@pytest.mark.parametrize(
    "changes",
    [
        {"name": "other"},
        {"seed": 9},
        {"trials": 9},
        {"sweep": SweepConfig(parameters={"scene.gravity_mps2": Range(min=9, max=10)})},
        {"run": RunConfig(simulations=7)},
        {"containers": ContainersConfig(image="other", sim=NodeContainerConfig(memory="512m"))},
        {"cluster": ClusterConfig(partition="long")},
        {"sim": Config().sim.model_copy(update={"real_time_factor": 1.0})},
        {"record": Config().record.model_copy(update={"zstd_level": 9, "trials_per_shard": 9})},
        {"until": UntilLanded(landed=9)},
        {"sweep": SweepConfig(parameters={"ball.mass_kg": Range(min=0.1, max=0.2)}, target=TARGET)},
    ],
)
def test_keys_without_effect_on_samples_do_not_change_digests(changes):
    assert digests(Config().model_copy(update=changes)) == digests(Config())


@pytest.mark.parametrize(
    "changes",
    [
        {"robot": Config().robot.model_copy(update={"posture": {"head_1_joint": 0.1}})},
        {"robot": Config().robot.model_copy(update={"locked": ["head_1_joint"]})},
        {"tool": Config().tool.model_copy(update={"cup_walls": 8})},
        {"scene": Config().scene.model_copy(update={"gravity_mps2": 9.8})},
        {"sim": Config().sim.model_copy(update={"physics_hz": 1000})},
        {"task": Config().task.model_copy(update={"points_hz": 40.0})},
        {"record": Config().record.model_copy(update={"rate_hz": 500})},
        {"controllers": ControllersConfig(hold="command")},
    ],
)
def test_keys_with_an_effect_on_samples_change_all_digests(changes):
    assert not set(digests(Config().model_copy(update=changes))) & set(digests(Config()))


def test_values_and_seed_of_a_trial_change_only_its_digest():
    first, second = digests(Config())
    other = Points(POINTS.keys, np.array([[0.1, 1.0], [0.2, np.nextafter(1.0, 2.0)]]))
    assert digests(Config(), other)[0] == first
    assert digests(Config(), other)[1] != second
    assert digests(Config(), seeds=(5, 7))[0] == first
    assert digests(Config(), seeds=(5, 7))[1] != second


def test_the_digest_of_a_configuration_leaves_out_how_it_is_run():
    otherwise = Config(run=RunConfig(simulations=9), containers=ContainersConfig(image="other"))
    assert config_digest(otherwise) == config_digest(Config())
    assert config_digest(Config(name="other")) != config_digest(Config())
