"""Throws are aimed at the cells of landings in which few have landed, by what the throws so far have shown."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.values import column_of
from throwcollect.dataset.reader import Dataset
from throwcollect.learning.covering import Grid, choose_throws
from throwcollect.plan.samplers import draw_points
from throwcollect.plan.trials import Points

PARAMETERS = {
    "task.duration_s": {"min": 0.5, "max": 2.0},
    "task.trajectory.gamma": {"min": 0.67, "max": 2.0},
    "task.end.arm_right_4_joint": {"min": -1.0, "max": 0.0},
    "scene.landing_height_m": {"min": 0.0, "max": 0.5},
}
TARGET = {
    "distance_m": {"min": 0.6, "max": 2.0, "bins": 8},
    "hit_angle_rad": {"min": 0.9, "max": 1.4, "bins": 6},
}
ROUNDS, COUNT = 6, 80


def config_with(**sweep: Any) -> Config:
    parts = {"parameters": PARAMETERS, "target": TARGET, **sweep}
    return Config.model_validate({"seed": 1, "trials": COUNT, "sweep": parts})


def throw(points: Points) -> Dataset:
    """Throws by formula: a flight whose start depends on the parameters in a way that is neither linear nor even."""
    duration, gamma, end, height = points.values.T
    swing, late, elevation = (duration - 0.5) / 1.5, (gamma - 0.67) / 1.33, 0.7 - 0.8 * end
    speed = 1 + 3 * swing**1.5 * (0.6 + 0.4 * late)
    level, up = speed * np.cos(elevation), speed * np.sin(elevation)
    time = (up + np.sqrt(up**2 + 2 * 9.81 * (1.3 - height))) / 9.81
    failed = (swing < 0.2) & (late > 0.7)
    columns = {
        **dict(zip(map(column_of, points.keys), points.values.T, strict=True)),
        "outcome": np.where(failed, "self_hit", "landed"),
        # The last digits depend on the processor.
        "landing_x_m": np.round(0.6 * level * time, 9),
        "landing_y_m": np.round(-0.8 * level * time, 9),
        "hit_angle_rad": np.round(np.arctan2(9.81 * time - up, level), 9),
        "effort_peak_share": np.full(len(time), 0.5),
    }
    return cast("Dataset", SimpleNamespace(throws=pa.table(columns)))


def count_landings(config: Config, datasets: list[Dataset]) -> NDArray[np.int64]:
    assert config.sweep.target is not None
    grid = Grid(config.sweep.target)
    throws = pa.concat_tables([each.throws for each in datasets])
    landed = throws.filter(np.array(throws["outcome"].to_pylist()) == "landed")
    columns = {name: landed[name].to_numpy() for name in landed.column_names if name != "outcome"}
    cells = grid.find_cells(grid.measure(columns))
    return np.bincount(cells[cells >= 0], minlength=math.prod(grid.shape))


def measure_evenness(counts: NDArray[np.int64]) -> float:
    """Entropy over that of equal counts."""
    shares = counts[counts > 0] / counts.sum()
    return float(-(shares * np.log(shares)).sum() / math.log(len(counts)))


def test_rounds_fill_the_cells_more_evenly_than_sobol_points() -> None:
    config = config_with()
    datasets = [throw(draw_points(config, directory=Path()))]
    for number in range(2, ROUNDS + 1):
        datasets.append(throw(choose_throws(config, datasets, count=COUNT, number=number)))
    many = config.model_copy(update={"trials": ROUNDS * COUNT})
    sobol = count_landings(config, [throw(draw_points(many, directory=Path()))])
    covered = count_landings(config, datasets)
    reached = (covered > 0) | (sobol > 0)
    assert not (sobol[reached] > 0).all()
    assert (covered[reached] > 0).sum() >= (sobol[reached] > 0).sum() + 3
    assert measure_evenness(covered[reached]) > 0.97 > 0.94 > measure_evenness(sobol[reached])


def test_equal_datasets_give_equal_throws_inside_of_the_ranges() -> None:
    config = config_with()
    datasets = [throw(draw_points(config, directory=Path()))]
    points = choose_throws(config, datasets, count=COUNT, number=2)
    assert points == choose_throws(config, datasets, count=COUNT, number=2)
    assert points != choose_throws(config, datasets, count=COUNT, number=3)
    assert points.keys == tuple(PARAMETERS)
    bounds = np.array([[each["min"], each["max"]] for each in PARAMETERS.values()]).T
    assert ((bounds[0] <= points.values) & (points.values <= bounds[1])).all()
    assert len(np.unique(points.values, axis=0)) == COUNT


def test_heights_are_those_of_the_cells_and_values_of_a_set_stay_in_it() -> None:
    target = {"distance_m": TARGET["distance_m"], "height_m": {"min": 0.2, "max": 0.3, "bins": 2}}
    parameters = {**PARAMETERS, "task.trajectory.gamma": {"values": [0.8, 1.2]}}
    config = config_with(target=target, parameters=parameters)
    points = choose_throws(config, [throw(draw_points(config, directory=Path()))], count=COUNT, number=2)
    heights = points.values[:, 3]
    assert ((heights >= 0.2) & (heights <= 0.3)).all()
    assert set(points.values[:, 1]) == {0.8, 1.2}
