"""The section of a report on a model."""

from pathlib import Path

import pytest
from tests.unit.learning.worlds import make_dataset
from tests.unit.publish.report.page_parser import list_panels

from throwcollect import fit
from throwcollect.dataset.reader import Dataset
from throwcollect.learning.model import load_model
from throwcollect.learning.score import Adapted, Errors, MissStatistics, Score, ThrowAtTarget, Trained
from throwcollect.publish.report.targets import show_model


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return make_dataset(tmp_path_factory.mktemp("data") / "data", 80)


@pytest.fixture
def model(dataset: Dataset, tmp_path: Path) -> Path:
    fit(dataset).save(tmp_path / "model")
    return tmp_path / "model"


def score() -> Score:
    errors = [Errors(throws=3, missed=1, median=each, share90=2 * each, largest=None) for each in (0.02, 0.001)]
    throws = [
        ThrowAtTarget(target=[1.0, 0.1], place=[1.01, 0.1]),
        ThrowAtTarget(target=[1.2, 0.0], place=[1.2, -0.02]),
        ThrowAtTarget(target=[1.1, -0.1], place=None),
    ]
    return Score(
        targets=3,
        seed=0,
        trained=[Trained(trained_on=number, errors=each) for number, each in zip((30, 80), errors, strict=True)],
        throws=throws,
        scatter=0.0,
        adapted=[
            Adapted(real_throws=number, method=method, errors=each)
            for number, method, each in zip((0, 5), ("none", "bias"), errors, strict=True)
        ],
        adapted_throws=throws[:2],
    )


def test_a_model_without_a_score_is_shown_with_the_command_that_scores_it(dataset: Dataset, model: Path) -> None:
    section = show_model(model, dataset)
    assert not list_panels(section)
    assert f"throwcollect score {model}" in section.text


def test_misses_are_drawn_as_arrows_from_their_targets(dataset: Dataset, model: Path) -> None:
    load_model(model).write_score(model, score())
    panels = {panel.key: panel.figure for panel in list_panels(show_model(model, dataset))}
    assert list(panels) == ["targets", "training", "adapting", "elsewhere"]
    axes = panels["targets"].layout
    assert (axes.xaxis.title.text, axes.yaxis.title.text) == ("landing_x_m", "landing_y_m")
    traces = {trace.name: trace for trace in panels["targets"].data}
    assert len(traces["throws of the dataset"].x) == 80
    assert list(traces["targets"].x) == [1.0, 1.2]
    assert list(traces["targets where no throw landed"].x) == [1.1]
    arrows = traces["misses × 10"]
    assert arrows.x[:2] == pytest.approx([1.0, 1.1])
    assert arrows.y[3:5] == pytest.approx([0.0, -0.2])
    assert arrows.x[2] is None


def test_curves_of_misses_over_numbers_of_throws_are_in_centimetres(dataset: Dataset, model: Path) -> None:
    load_model(model).write_score(model, score())
    section = show_model(model, dataset)
    panels = {panel.key: panel.figure for panel in list_panels(section)}
    median = panels["adapting"].data[0]
    assert list(median.x) == [0, 5]
    assert median.y == pytest.approx([2.0, 0.1])
    (table,) = (block for block in section.blocks if hasattr(block, "rows"))
    assert table.rows[-1] == ("in the other world after 5 throws (bias)", "0.10 cm", "0.20 cm", "-", "3", "1")


def test_every_unit_has_its_own_curves_and_the_distilled_map_has_a_row(dataset: Dataset, model: Path) -> None:
    angles = MissStatistics(unit="rad", median=0.01, share90=0.02, largest=0.02)
    found = score()
    mixed = found.trained[-1].errors.model_copy(update={"others": [angles]})
    trained = [each.model_copy(update={"errors": mixed}) for each in found.trained]
    load_model(model).write_score(
        model, found.model_copy(update={"trained": trained, "distilled": mixed, "adapted": []})
    )
    section = show_model(model, dataset)
    panels = {panel.key: panel.figure for panel in list_panels(section)}
    assert list(panels) == ["targets", "training", "training-rad"]
    assert panels["training-rad"].data[0].y == pytest.approx([0.573, 0.573], abs=0.001)
    assert panels["training-rad"].layout.yaxis.title.text == "angle from the target [°]"
    assert panels["training"].data[0].y == pytest.approx([0.1, 0.1])
    (table,) = (block for block in section.blocks if hasattr(block, "rows"))
    assert table.rows[-1] == ("model.onnx of these", "0.10 cm, 0.57°", "0.20 cm, 1.15°", "-, 1.15°", "3", "1")
