"""A report shows what cameras saw, and crops maps to their points."""

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from throwcollect.dataset.reader import Dataset
from throwcollect.report.cameras import show_cameras
from throwcollect.report.contents import Table
from throwcollect.report.figures import Points, draw_map
from throwcollect.report.measured import Outcomes

SENSORS = {
    "side": {"kind": "camera"},
    "deep": {"kind": "depth", "noise": {"dropout": 0.05}},
    "scan": {"kind": "lidar_2d"},
}


@pytest.fixture(scope="module")
def seen(make_collection: Any, tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return Dataset.open(make_collection({"trials": 5, "sensors": SENSORS}).collect(tmp_path_factory.mktemp("seen")))


def read(cell: str) -> np.ndarray:
    data = cell.partition("base64,")[2].partition('"')[0]
    return np.array(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"), int)


# A depth that is missing has no shade to be cast to.
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_each_camera_has_a_row_of_pictures_for_each_of_a_few_trials(seen: Dataset) -> None:
    (section,) = show_cameras(seen)
    side, side_pictures, deep, deep_pictures = section.blocks
    assert "<b>deep</b>" in str(deep)
    assert "<b>side</b>" in str(side)
    assert isinstance(side_pictures, Table)
    assert [row[0] for row in side_pictures.rows] == [f"trial {trial}, landed" for trial in (0, 1, 3, 4)]
    frames, row = seen[3].sensors["side"], side_pictures.rows[2]
    for number, cell in ((0, row[1]), (len(frames) - 1, row[6])):
        assert np.abs(read(cell) - frames.images[number]).mean() < 3
        assert f"{frames.time_s[number]:.2f} s" in cell
    # The robot is nearer than the ground behind it.
    assert isinstance(deep_pictures, Table)
    depth, shades = seen[0].sensors["deep"].depth_m[0], read(deep_pictures.rows[0][1])[..., 0]
    assert shades[depth < 4].mean() > shades[depth > 6].mean() + 30


def test_a_dataset_without_cameras_has_no_section(collected: Path) -> None:
    assert list(show_cameras(Dataset.open(collected))) == []


def map_of(x: list[float], y: list[float]) -> Any:
    outcomes = Outcomes.of(["landed"] * len(x), ("landed",))
    numbers = np.arange(len(x))
    places, zeros = (np.array(x), np.array(y)), np.zeros(len(x))
    return draw_map(Points(numbers, numbers, *places, zeros, zeros, outcomes.codes), outcomes, speed=None)


def test_a_map_is_cropped_to_its_points_and_an_arrow_leads_to_the_robot() -> None:
    figure = map_of([2.0, 3.0], [-0.5, 0.5])
    assert figure.layout.xaxis.range == pytest.approx((1.85, 3.15))
    assert figure.layout.yaxis.range == pytest.approx((-0.65, 0.65))
    robot = figure.data[-1]
    assert (robot.x[0], robot.y[0]) == pytest.approx((1.85, 0.0))
    assert (robot.marker.symbol, robot.marker.angle) == ("arrow", pytest.approx(-90))
    assert robot.name == "robot, 1.9 m farther"


def test_a_robot_among_the_points_of_a_map_is_drawn_where_it_is() -> None:
    robot = map_of([-1.0, 1.0], [0.0, 1.0]).data[-1]
    assert (robot.name, robot.marker.symbol, robot.x[0], robot.y[0]) == ("robot", "star-triangle-up", 0, 0)
