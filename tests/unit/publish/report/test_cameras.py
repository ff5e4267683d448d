"""A report shows what cameras saw, and crops maps to their points."""

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from throwcollect.dataset.reader import Dataset
from throwcollect.publish.report.cameras import show_cameras
from throwcollect.publish.report.contents import Table

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
