import json

import pytest
from tests.unit.plan.own_plan import make_plan

from throwcollect.build import build_digest
from throwcollect.config.schema import Config
from throwcollect.config.values import sweepable_keys, values_by_key, with_values
from throwcollect.plan import conditions
from throwcollect.plan.conditions import Settings, explain_difference
from throwcollect.sim.simulator import Simulator
from throwcollect.tasks.task import trajectory_of

CONFIG = Config()
WITHOUT_EFFECT = {
    "sim.real_time_factor": 2.0,
    "record.trials_per_shard": 7,
    "task.duration_s": 1.5,
    "task.points_hz": 50.0,
    "task.recatch_gap_s": 0.1,
    "run.simulations": 5,
}


WANTED = ("build", "settings", '{"ball.mass_kg": 0.05}', "trajectory")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (0, "its sources, its physics engine or its robot model are not those of the coordinator"),
        (1, "its configuration is another one"),
        (2, "its values are not those of the plan"),
        (3, "its controllers were given another trajectory"),
    ],
)
def test_each_difference_of_conditions_is_named(line: int, said: str) -> None:
    used = [each if number != line else "x" for number, each in enumerate(WANTED)]
    assert explain_difference("\n".join(used), "\n".join(WANTED)) == said
    assert explain_difference("\n".join(WANTED), "\n".join(WANTED)) is None


@pytest.mark.parametrize("used", ["", "build", "build\nsettings"])
def test_conditions_that_lack_lines_are_others(used: str) -> None:
    assert explain_difference(used, "\n".join(WANTED))


def change(key: str, value: object) -> Config:
    section, _, name = key.rpartition(".")
    holder = getattr(CONFIG, section)
    return CONFIG.model_copy(update={section: holder.model_copy(update={name: value})})


@pytest.mark.parametrize("key", WITHOUT_EFFECT)
def test_keys_that_simulations_ignore_do_not_change_the_settings_digest(key: str) -> None:
    assert Settings(change(key, WITHOUT_EFFECT[key])).digest == Settings(CONFIG).digest


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("robot.base_height_m", 1.1),
        ("tool.cup_walls", 8),
        ("ball.friction", 0.1),
        ("scene.gravity_mps2", 1.6),
        ("sim.physics_hz", 1000),
        ("record.zstd_level", 3),
        ("task.end", {"arm_right_4_joint": -0.5}),
        ("task.start", {**CONFIG.task.start, "arm_right_4_joint": -1.8}),
    ],
)
def test_keys_that_simulations_use_change_the_settings_digest(key: str, value: object) -> None:
    before = values_by_key(CONFIG)
    assert before.get(key) != value
    assert Settings(change(key, value)).digest != Settings(CONFIG).digest


def test_conditions_name_each_value_that_a_trial_changes_whether_it_is_planned_or_used() -> None:
    settings = Settings(CONFIG)
    assert settings.conditions_of(settings.read_values(CONFIG), "").split("\n")[2] == "{}"
    changed = {"ball.mass_kg": 0.06, "task.duration_s": 1.3, "task.start.arm_right_4_joint": -1.8}
    assert set(changed) <= set(sweepable_keys(CONFIG))
    planned = settings.conditions_of({**changed, "ball.friction": CONFIG.ball.friction}, "")
    assert json.loads(planned.split("\n")[2]) == changed
    assert settings.conditions_of(settings.read_values(with_values(CONFIG, changed)), "") == planned


def test_the_conditions_of_a_simulated_episode_are_those_of_its_trial_alone() -> None:
    drawn = {"trials": 2, "sweep": {"sampler": "uniform", "parameters": {"ball.mass_kg": {"min": 0.03, "max": 0.06}}}}
    plan = make_plan(Config.model_validate(drawn))
    simulator, settings = Simulator(plan.config), Settings(plan.config)
    episode = simulator.run(plan.trials[1])
    simulator.close()
    motion = trajectory_of(plan.config).digest
    expected = [settings.conditions_of(trial.values, motion) for trial in plan.trials]
    assert explain_difference(episode.conditions, expected[1]) is None
    assert "its values are not those" in (explain_difference(episode.conditions, expected[0]) or "")


def test_the_digest_of_a_build_is_the_same_when_it_is_computed_anew() -> None:
    assert build_digest.__wrapped__("bullet") == build_digest("bullet")
    assert len(build_digest("bullet")) == 64


def test_the_build_of_a_configuration_is_that_of_the_parts_that_it_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conditions, "build_digest", lambda *parts: parts)
    assert conditions.build_of(CONFIG) == ("bullet", "talos", "spoon", "throw")
