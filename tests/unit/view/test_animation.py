"""An animation of a throw lasts as long as the throw, and shows robot, ball and path."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.view.animation import Animation, camera_on, render


def picture(path: Path, number: int) -> NDArray[np.int_]:
    with Image.open(path) as file:
        file.seek(number)
        return np.array(file.convert("RGB"), int)


def count_flight(pixels: NDArray[np.int_]) -> int:
    """Pixels with the colour of the path in flight, which is that of the outcome."""
    return int((np.abs(pixels - [0x00, 0x72, 0xB2]).sum(axis=2) < 90).sum())


@pytest.fixture(scope="module")
def written(collected: Path, tmp_path_factory: pytest.TempPathFactory) -> Animation:
    return render(collected, tmp_path_factory.mktemp("render") / "throw.webp", trial=4)


@pytest.fixture(scope="module")
def fast(collected: Path, tmp_path_factory: pytest.TempPathFactory) -> Animation:
    """A faster animation of the same throw, which has fewer pictures to draw."""
    return render(collected, tmp_path_factory.mktemp("fast") / "throw.GIF", trial=4, slow=0.2)


def test_an_animation_lasts_as_long_as_its_throw(collected: Path, written: Animation) -> None:
    throw = Dataset.open(collected).throws.to_pylist()[4]
    assert written.duration_s == pytest.approx(throw["landing_time_s"], abs=0.06)
    with Image.open(written.file) as file:
        assert file.format == "WEBP"
        assert file.n_frames == written.pictures
    assert written.size_bytes == written.file.stat().st_size < 2_000_000


def test_the_robot_moves_and_the_path_grows(written: Animation) -> None:
    first, middle, last = (picture(written.file, at) for at in (0, written.pictures * 2 // 3, written.pictures - 1))
    assert (first.sum(axis=2) < 150).mean() > 0.01  # Talos has black legs
    assert np.abs(first - middle).max() > 100
    assert count_flight(first) < count_flight(middle) < count_flight(last)


def test_a_faster_animation_is_shorter_and_has_fewer_pictures(written: Animation, fast: Animation) -> None:
    assert fast.duration_s == pytest.approx(0.2 * written.duration_s, abs=0.11)
    assert fast.pictures < written.pictures / 4
    assert fast.file.read_bytes()[:6] == b"GIF89a"


def test_bodies_are_drawn_in_their_colours(make_collection: Any, tmp_path: Path) -> None:
    pole = {"shape": "cylinder", "position_m": [0.9, -0.5, 0.5], "radius_m": 0.15, "length_m": 1.0, "color": "#20c040"}
    collected = make_collection({"trials": 1, "scene": {"bodies": {"pole": pole}}}).collect(tmp_path / "a")
    pixels = picture(render(collected, tmp_path / "throw.webp", slow=0.1).file, 0)
    green = (pixels[..., 1] > 1.8 * pixels[..., 0]) & (pixels[..., 1] > 1.8 * pixels[..., 2])
    # Its height over its width; its middle, as the edges are not sharp.
    assert np.median(green.sum(axis=0)[green.any(axis=0)]) / np.median(green.sum(axis=1)[green.any(axis=1)]) > 2


def test_the_camera_sees_all_points_and_stands_no_farther_than_needed() -> None:
    points = np.random.default_rng(1).uniform([-0.5, -0.5, 0], [3, 1, 2], (200, 3))
    shares = camera_on(points, 1.6).project(points)
    assert shares.min() > 0
    assert shares.max() < 1
    assert min(shares.min(), 1 - shares.max()) == pytest.approx(0.06)


@pytest.mark.parametrize("heading", [-1.0, 0.0, 1.5, 3.0])
def test_a_throw_leads_to_the_right_of_the_picture_wherever_it_goes(heading: float) -> None:
    away = np.array([np.cos(heading), np.sin(heading), 0.0])
    path = np.linspace(0, 1, 20)[:, np.newaxis] * away + [0, 0, 1]
    (left, _), *_, (right, _) = camera_on(path, 1.6, heading).project(path)
    assert right - left == pytest.approx(0.88)


def test_an_unknown_trial_or_kind_of_picture_is_an_error(collected: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no trial 7"):
        render(collected, tmp_path / "throw.webp", trial=7)
    with pytest.raises(ConfigError, match=r"throw.mp4: no animated picture ends like this\n.*\.webp or \.gif"):
        render(collected, tmp_path / "throw.mp4")
    assert not list(tmp_path.glob("throw.*"))
