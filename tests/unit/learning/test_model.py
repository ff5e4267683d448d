"""Models: learned from datasets, written, read, and used by programs that have nothing but a file."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from tests.unit.learning.worlds import DRAG, KEYS, TARGETS, draw, land, make_dataset

from throwcollect import ConfigError, DatasetError, Model, fit, load_model
from throwcollect.config.values import column_of
from throwcollect.dataset.reader import Dataset
from throwcollect.learning.model import read_score
from throwcollect.learning.model_card import PROGRAM
from throwcollect.learning.score import Adapted, Errors, MissStatistics, Score, ThrowAtTarget, Trained

COUNT = 120


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return make_dataset(tmp_path_factory.mktemp("data") / "data", COUNT)


@pytest.fixture(scope="module")
def model(dataset: Dataset) -> Model:
    return fit(dataset)


def change(dataset: Dataset, column: str, values: object) -> Dataset:
    field = dataset.throws.schema.field(column)
    at = dataset.throws.schema.get_field_index(column)
    return replace(dataset, throws=dataset.throws.set_column(at, field, pa.array(values, field.type)))


def test_keys_of_the_task_become_parameters_and_those_of_the_world_latents(model: Model) -> None:
    assert sorted(model.parameters) == sorted(KEYS)
    assert (model.given, model.latents, model.targets) == ((), (DRAG.key,), TARGETS)
    assert model.trained_on.throws == COUNT


def test_a_model_can_be_learned_from_throws_that_end_close_together(dataset: Dataset) -> None:
    near = dataset
    for number, column in enumerate(TARGETS):
        near = change(near, column, [1.0 + 1e-5 * ((7 * k + number) % COUNT) for k in range(COUNT)])
    model = fit(near)
    assert model.targets == TARGETS
    points = [{key: near.throws[column_of(key)][k].as_py() for key in KEYS} for k in range(3)]
    assert model.predict(points) == pytest.approx(np.full((3, 2), 1.0 + 5e-6 * COUNT), abs=5e-3)


def test_aiming_at_no_targets_gives_no_aims(model: Model) -> None:
    assert model.aim([]) == []


def test_parameters_and_context_keys_of_a_model_can_be_chosen(dataset: Dataset) -> None:
    model = fit(dataset, parameters=KEYS[:2], given=KEYS[2:])
    assert (sorted(model.parameters), model.given, model.latents) == (sorted(KEYS[:2]), KEYS[2:], (DRAG.key,))
    (aim,) = model.aim([(1.2, -0.2, 0.0)])
    assert aim.parameters[KEYS[2]] == 0.0
    assert not model.aim([(1.2, -0.2, 3.0)])[0].reachable


def test_the_files_of_a_model_are_the_same_when_fitted_or_loaded_again(
    dataset: Dataset, model: Model, tmp_path: Path
) -> None:
    for name, each in (("one", model), ("two", fit(dataset))):
        each.save(tmp_path / name)
    load_model(tmp_path / "one").save(tmp_path / "three")
    files = {path.name: path.read_bytes() for path in (tmp_path / "one").iterdir()}
    assert sorted(files) == ["README.md", "config.yaml", "model.json", "points.parquet"]
    for name in ("two", "three"):
        assert {path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} == files
    point = [model.aim([(1.2, -0.2)])[0].parameters]
    assert load_model(tmp_path / "one").predict(point).tolist() == model.predict(point).tolist()


def test_the_program_of_the_card_aims_with_nothing_but_the_model_files(dataset: Dataset, tmp_path: Path) -> None:
    fit(dataset).save(tmp_path / "model")
    assert PROGRAM.rstrip() in (tmp_path / "model" / "README.md").read_text()
    script = f"target = [1.2, -0.2]\n{PROGRAM}\nprint(json.dumps(parameters))"
    said = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path / "model", capture_output=True, text=True, check=True
    )
    found = json.loads(said.stdout)
    values = np.array([[found[key] for key in KEYS]])
    assert land(values, 0.0)[0] == pytest.approx([1.2, -0.2], abs=0.03)


def test_a_saved_adapted_model_keeps_its_adaptation_in_file_and_card(model: Model, tmp_path: Path) -> None:
    points = [dict(zip(KEYS, row, strict=True)) for row in draw(4, 8).tolist()]
    adapted = model.adapt(points, land(draw(4, 8), 0.9).tolist(), method="latent")
    (found,) = (each for each in adapted.adaptation.found if each.name == DRAG.key)
    assert found.value == pytest.approx(0.9, abs=0.15)
    adapted.save(tmp_path / "real")
    again = load_model(tmp_path / "real")
    assert again.predict(points).tolist() == adapted.predict(points).tolist() != model.predict(points).tolist()
    assert f"| `{DRAG.key}` |" in (tmp_path / "real" / "README.md").read_text().split("## Adapted")[1]


def test_a_score_is_stored_in_the_model_and_shown_in_its_card(model: Model, tmp_path: Path) -> None:
    errors = Errors(throws=2, missed=1, median=0.0012, share90=None, largest=None)
    angles = MissStatistics(unit="rad", median=0.01, share90=0.02, largest=None)
    score = Score(
        targets=2,
        seed=0,
        trained=[Trained(trained_on=120, errors=errors)],
        distilled=errors.model_copy(update={"median": 0.01, "others": [angles]}),
        throws=[ThrowAtTarget(target=[1.0, 0.0], place=[1.0, 0.0012]), ThrowAtTarget(target=[1.1, 0.0], place=None)],
        scatter=0.02,
        adapted=[Adapted(real_throws=0, method="none", errors=errors)],
        adapted_throws=[],
    )
    model.save(tmp_path / "model")
    assert read_score(tmp_path / "model") is None
    model.write_score(tmp_path / "model", score)
    assert read_score(tmp_path / "model") == score
    card = (tmp_path / "model" / "README.md").read_text()
    assert "| learned from 120 throws | 0.12 cm | - | - | 2 | 1 |" in card
    assert "| model.onnx of these | 1.00 cm, 0.57° | -, 1.15° | - | 2 | 1 |" in card
    assert "| in the other world after 0 throws (none) | 0.12 cm | - | - | 2 | 1 |" in card
    # The page of a report shows the same rows.
    assert [row[0] for row in score.list_rows()] == [
        line.split(" | ")[0].removeprefix("| ") for line in card.splitlines() if line.endswith(" | 2 | 1 |")
    ]
    assert "with a scatter of 2.00 cm" in card


def test_fit_leaves_out_throws_that_did_not_land(dataset: Dataset) -> None:
    found = fit(change(dataset, "outcome", ["self_hit"] * 20 + ["landed"] * (COUNT - 20)))
    assert (found.trained_on.throws, found.trained_on.ignored) == (COUNT - 20, 20)
    assert len(found.outputs) == COUNT - 20


def test_a_constant_parameter_is_left_out_or_refused_by_name(dataset: Dataset) -> None:
    constant = change(dataset, column_of(KEYS[2]), [0.1] * COUNT)
    assert KEYS[2] not in fit(constant).parameters
    with pytest.raises(ConfigError, match=r"torso_1_joint has the value 0\.1 in all throws"):
        fit(constant, parameters=KEYS)
    with pytest.raises(ConfigError, match=r"torso_1_joint has the value 0\.1 in all throws"):
        fit(constant, given=KEYS[2:3])


def test_adapting_refuses_throws_far_outside_of_the_learned_ranges(model: Model, dataset: Dataset) -> None:
    points = [dict(zip(KEYS, row, strict=True)) for row in draw(2, 8).tolist()]
    points[1][KEYS[1]] = 45.0
    with pytest.raises(ConfigError, match=f"throw 1: {KEYS[1]} is 45\\n  expected: about .* to .*, the range"):
        model.adapt(points, land(draw(2, 8), 0.0).tolist())
    given = fit(dataset, given=[KEYS[1]])
    points[1][KEYS[1]] = 1e200
    with pytest.raises(ConfigError, match=f"throw 1: {KEYS[1]} is 1e\\+200"):
        given.adapt(points, land(draw(2, 8), 0.0).tolist())


@pytest.mark.parametrize(
    ("file", "change", "message"),
    [
        ("model.json", lambda text: text[:100], "Invalid JSON"),
        ("model.json", lambda text: re.sub(r'"errors": {[^}]*}', '"errors": {}', text), "errors"),
    ],
)
def test_loading_a_damaged_model_is_an_error_that_names_the_file(
    model: Model, tmp_path: Path, file: str, change, message: str
) -> None:
    model.save(tmp_path / "model")
    path = tmp_path / "model" / file
    path.write_text(change(path.read_text()))
    with pytest.raises(DatasetError, match=message) as caught:
        load_model(tmp_path / "model")
    assert caught.value.path == path


@pytest.mark.parametrize("targets", [["landing_x_m", "effort_peak_share"], [column_of(KEYS[0])]])
def test_a_target_that_is_also_an_effort_or_key_column_survives_saving(
    dataset: Dataset, tmp_path: Path, targets: list[str]
) -> None:
    model = fit(dataset, targets=targets)
    model.save(tmp_path / "model")
    again = load_model(tmp_path / "model")
    assert again.targets == tuple(targets)
    assert np.array_equal(again.outputs, model.outputs)
