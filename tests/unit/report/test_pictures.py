"""The pictures of a report in the size in which they are printed."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image as image
import pytest

from throwcollect.dataset.reader import Dataset
from throwcollect.report.painter import write_pictures
from throwcollect.report.sections import report_dataset


@pytest.fixture(scope="module")
def pictures(collected: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    return write_pictures(report_dataset(Dataset.open(collected)).sections, tmp_path_factory.mktemp("pictures"))


def test_pictures_are_one_column_wide_in_print_and_not_blank(pictures: tuple[Path, ...]) -> None:
    names = {picture.name for picture in pictures}
    assert names == {
        f"{name}.png"
        for name in (
            "landing_map",
            "release",
            "target_coverage",
            "parameters",
            "outcomes",
            "limits",
            "ballistic_residuals",
            "ball_paths",
            "joint_tracking",
        )
    }
    for picture in pictures:
        pixels = image.imread(picture)
        assert pixels.shape[1] == 1050, picture.name  # 3.5 in at 300 dpi
        assert (pixels[..., :3].min(axis=2) < 0.9).mean() > 0.01, picture.name
        for edge in (pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]):
            assert edge.min() > 0.9, f"{picture.name} is cut off"
