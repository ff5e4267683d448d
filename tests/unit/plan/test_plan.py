import os

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.unit.plan.columns import in_columns
from tests.unit.plan.own_plan import make_plan

from throwcollect.config.run import RunConfig
from throwcollect.config.schema import Config, Range, SweepConfig, Values
from throwcollect.errors import DatasetError, PlanError
from throwcollect.plan.plan import Plan
from throwcollect.plan.trials import Trial

PARAMETERS = {"ball.mass_kg": Range(min=0.01, max=1, scale="log"), "task.duration_s": Range(min=1, max=3)}


def make_config(trials: int = 8, *, seed: int = 0, name: str = "throws") -> Config:
    return Config(name=name, seed=seed, trials=trials, sweep=SweepConfig(parameters=PARAMETERS))


def heavy(config: Config) -> str | None:
    return f"the ball of {config.ball.mass_kg:.3f} kg is too heavy" if config.ball.mass_kg > 0.1 else None


def test_trials_are_numbered_from_zero_and_differ():
    plan = make_plan(make_config())
    assert [trial.number for trial in plan.trials] == list(range(8))
    assert plan.keys == ("ball.mass_kg", "task.duration_s")
    assert len({trial.digest for trial in plan.trials}) == len({trial.seed for trial in plan.trials}) == 8
    assert all(trial.refused is None for trial in plan.trials)


def test_the_configuration_of_a_trial_differs_only_in_its_values():
    plan = make_plan(make_config())
    trial = plan.trials[3]
    config = plan.config_of(trial)
    assert (config.ball.mass_kg, config.task.duration_s) == tuple(trial.values.values())
    assert config.scene == plan.config.scene
    assert config.task.end == plan.config.task.end


def test_seeds_depend_only_on_root_seed_and_trial_number():
    seeds = [trial.seed for trial in make_plan(make_config(4)).trials]
    assert [trial.seed for trial in make_plan(make_config(8)).trials][:4] == seeds
    assert not set(seeds) & {trial.seed for trial in make_plan(make_config(4, seed=1)).trials}
    assert seeds == [int(child.generate_state(1, np.uint64)[0]) for child in np.random.SeedSequence(0).spawn(4)]


def test_a_longer_plan_keeps_the_earlier_trials():
    assert make_plan(make_config(11)).trials[:5] == make_plan(make_config(5)).trials


def test_the_check_refuses_single_trials_with_its_reason():
    plan = make_plan(make_config(), check=heavy)
    refused = [trial for trial in plan.trials if trial.refused]
    assert 0 < len(refused) < 8
    for trial in plan.trials:
        assert trial.refused == heavy(plan.config_of(trial))


def test_a_plan_of_refused_trials_is_an_error_that_lists_the_commonest_reasons():
    def check(config: Config) -> str:
        return heavy(config) or f"arm_right_4_joint needs {config.ball.mass_kg:.2f} Nm"

    masses = Values(values=[0.01, 0.2, 0.3, 0.4, 0.02])
    config = Config(sweep=SweepConfig(sampler="grid", parameters={"ball.mass_kg": masses}))
    with pytest.raises(
        PlanError,
        match=r"^sweep: 5 trials, all refused: 3 × the ball of 0\.200 kg is too heavy; "
        r"2 × arm_right_4_joint needs 0\.01 Nm\n  try: sweep over smaller ranges",
    ):
        make_plan(config, check=check)


def test_a_list_of_points_is_read_from_beside_the_configuration(tmp_path):
    (tmp_path / "list.csv").write_text("ball.mass_kg\n0.5\n0.6\n0.7\n")
    config = Config(trials=2, sweep=SweepConfig(sampler="list", file="list.csv"))
    plan = make_plan(config, directory=tmp_path)
    assert [dict(trial.values) for trial in plan.trials] == [{"ball.mass_kg": 0.5}, {"ball.mass_kg": 0.6}]
    with pytest.raises(PlanError, match=r"^trials: should be at most 3, as the sweep has no more points, got 4$"):
        make_plan(config.model_copy(update={"trials": 4}), directory=tmp_path)


finite = st.floats(allow_nan=False, allow_infinity=False)
rows = st.tuples(finite, finite, st.integers(0, 2**64 - 1), st.one_of(st.none(), st.text(st.characters(codec="utf-8"))))


@settings(deadline=None, max_examples=40)
@given(st.lists(rows, min_size=1, max_size=20))
def test_a_written_plan_is_read_back_equal(tmp_path_factory, rows):
    path = tmp_path_factory.getbasetemp() / "plan.parquet"
    trials = [
        Trial(number, {"ball.mass_kg": mass, "task.duration_s": duration}, seed, f"{number:064x}", refused)
        for number, (mass, duration, seed, refused) in enumerate(rows)
    ]
    plan = Plan(make_config(), in_columns(trials))
    plan.write(path)
    assert Plan.read(path, make_config()) == plan


def test_equal_plans_give_equal_files_and_no_temporary_ones(tmp_path):
    for name in ("a", "b"):
        make_plan(make_config(), check=heavy).write(tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert sorted(os.listdir(tmp_path)) == ["a", "b"]


def test_the_file_of_a_plan_has_one_column_per_swept_key(tmp_path):
    plan = make_plan(make_config(), check=heavy)
    plan.write(tmp_path / "plan.parquet")
    table = pq.read_table(tmp_path / "plan.parquet")
    kinds = {field.name: str(field.type) for field in table.schema}
    assert kinds == {
        "trial": "int64",
        "digest": "string",
        "seed": "uint64",
        "refused": "string",
        "ball.mass_kg": "double",
        "task.duration_s": "double",
    }
    assert table["ball.mass_kg"].to_pylist() == [trial.values["ball.mass_kg"] for trial in plan.trials]


def test_a_plan_can_be_read_with_other_run_keys_but_not_with_another_seed(tmp_path):
    path = tmp_path / "plan.parquet"
    make_plan(make_config()).write(path)
    other_run = make_config().model_copy(update={"run": RunConfig(simulations=9)})
    assert len(Plan.read(path, other_run).trials) == 8
    with pytest.raises(DatasetError, match=r"plan\.parquet: the plan belongs to another configuration$"):
        Plan.read(path, make_config(seed=1))


def test_a_cut_plan_or_one_with_relevant_flipped_bits_is_an_error(tmp_path):
    path = tmp_path / "plan.parquet"
    plan = make_plan(make_config(), check=heavy)
    plan.write(path)
    content = path.read_bytes()
    for length in range(0, len(content), 97):
        path.write_bytes(content[:length])
        with pytest.raises(DatasetError, match=r"plan\.parquet: is damaged: "):
            Plan.read(path, make_config())
    noticed = 0
    for position in range(0, len(content), 7):
        path.write_bytes(content[:position] + bytes([content[position] ^ 1]) + content[position + 1 :])
        try:
            assert Plan.read(path, make_config()) == plan
        except DatasetError:
            noticed += 1
    assert noticed > 100
