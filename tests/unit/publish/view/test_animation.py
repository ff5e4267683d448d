"""Pictures of throws show robot, ball and path, from start to end, in the format that was asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from throwcollect.dataset.reader import Dataset
from throwcollect.engines.pose import OPTICAL
from throwcollect.errors import ConfigError
from throwcollect.publish.view.animation import Rendering, render
from throwcollect.publish.view.throw_pictures import camera_on, project


def picture(path: Path, number: int) -> NDArray[np.int_]:
    with Image.open(path) as file:
        file.seek(number)
        return np.array(file.convert("RGB"), int)


def count_flight(pixels: NDArray[np.int_]) -> int:
    """Pixels with the colour of the path in flight, which is that of the outcome."""
    return int((np.abs(pixels - [0x00, 0x72, 0xB2]).sum(axis=2) < 90).sum())


@pytest.fixture(scope="module")
def written(collected: Path, tmp_path_factory: pytest.TempPathFactory) -> Rendering:
    """An animation at twice the speed, which has half of the pictures to draw."""
    return render(collected, tmp_path_factory.mktemp("render") / "throw.webp", trials=[4], slow=0.5)


def test_an_animation_lasts_as_long_as_its_throw(collected: Path, written: Rendering) -> None:
    throw = Dataset.open(collected).throws.to_pylist()[4]
    assert 2 * written.duration_s == pytest.approx(throw["landing_time_s"], abs=0.12)
    with Image.open(written.file) as file:
        assert file.format == "WEBP"
        assert file.n_frames == written.pictures
    assert written.size_bytes == written.file.stat().st_size < 2_000_000


def test_the_robot_moves_and_the_path_grows(written: Rendering) -> None:
    first, middle, last = (picture(written.file, at) for at in (0, written.pictures * 2 // 3, written.pictures - 1))
    assert (first.sum(axis=2) < 150).mean() > 0.01  # Talos has black legs
    assert np.abs(first - middle).max() > 100
    assert count_flight(first) < count_flight(middle) < count_flight(last)


def test_bodies_are_drawn_in_their_colours(make_collection: Any, tmp_path: Path) -> None:
    pole = {"shape": "cylinder", "position_m": [0.9, -0.5, 0.5], "radius_m": 0.15, "length_m": 1.0, "color": "#20c040"}
    collected = make_collection({"trials": 1, "scene": {"bodies": {"pole": pole}}}).collect(tmp_path / "a")
    pixels = picture(render(collected, tmp_path / "throw.webp", slow=0.1).file, 0)
    green = (pixels[..., 1] > 1.8 * pixels[..., 0]) & (pixels[..., 1] > 1.8 * pixels[..., 2])
    # Its height over its width; its middle, as the edges are not sharp.
    assert np.median(green.sum(axis=0)[green.any(axis=0)]) / np.median(green.sum(axis=1)[green.any(axis=1)]) > 2


def test_the_camera_sees_all_points_and_stands_no_farther_than_needed() -> None:
    points = np.random.default_rng(1).uniform([-0.5, -0.5, 0], [3, 1, 2], (200, 3))
    shares = find_shares(points, 0.0)
    assert shares.min() > 0
    assert shares.max() < 1
    assert min(shares.min(), 1 - shares.max()) == pytest.approx(0.06)


def find_shares(points: NDArray[np.float64], heading: float) -> NDArray[np.float64]:
    """Places in the picture of a camera that stands for these points, as shares of its width and height."""
    camera = camera_on(points, (640, 400), heading)
    pixels, depth = project(camera, camera.pose * OPTICAL, points)
    assert depth.min() > 0
    return pixels / (640, 400)


@pytest.mark.parametrize("heading", [-1.0, 0.0, 1.5, 3.0])
def test_a_throw_leads_to_the_right_of_the_picture_wherever_it_goes(heading: float) -> None:
    away = np.array([np.cos(heading), np.sin(heading), 0.0])
    path = np.linspace(0, 1, 20)[:, np.newaxis] * away + [0, 0, 1]
    (left, _), *_, (right, _) = find_shares(path, heading)
    assert right - left == pytest.approx(0.88)


def test_throws_stand_side_by_side_and_begin_together(collected: Path, tmp_path: Path) -> None:
    written = render(collected, tmp_path / "throws.GIF", trials=[0, 4], size=(320, 200), slow=0.2)
    times_s = dict(
        zip(*(Dataset.open(collected).throws[each].to_pylist() for each in ("trial", "landing_time_s")), strict=True)
    )
    assert written.trials == (0, 4)
    assert written.file.read_bytes()[:6] == b"GIF89a"
    assert written.duration_s == pytest.approx(0.2 * max(times_s[0], times_s[4]), abs=0.06)
    first, last = (picture(written.file, at) for at in (0, written.pictures - 1))
    assert first.shape == (200, 642, 3)
    for half in (slice(320), slice(322, None)):
        assert count_flight(first[:, half]) < count_flight(last[:, half])


def test_a_video_has_the_pictures_of_the_throw(collected: Path, tmp_path: Path) -> None:
    written = render(collected, tmp_path / "throw.mp4", trials=[4], size=(161, 101), slow=0.2)
    with av.open(str(written.file)) as container:
        pictures = [frame.to_ndarray(format="rgb24").astype(int) for frame in container.decode(video=0)]
    # The last picture stays for 1.2 s.
    assert len(pictures) == written.pictures + 24
    assert pictures[0].shape == (100, 160, 3)
    still = picture(render(collected, tmp_path / "throw.png", trials=[4], size=(161, 101)).file, 0)
    assert np.abs(pictures[-1] - still[:100, :160]).mean() < 3


def test_nothing_is_drawn_through_what_stands_in_front(make_collection: Any, tmp_path: Path) -> None:
    wall = {"shape": "box", "position_m": [1.0, -0.6, 1.5], "size_m": [4.0, 0.02, 3.0], "color": "#20c040"}
    open_, walled = (
        render(
            make_collection({"trials": 1, "scene": {"bodies": bodies}}).collect(tmp_path / name),
            tmp_path / f"{name}.png",
            size=(320, 200),
        )
        for name, bodies in (("open", {}), ("walled", {"wall": wall}))
    )
    assert count_flight(picture(open_.file, 0)) > 10
    assert count_flight(picture(walled.file, 0)) == 0


def test_a_camera_of_the_configuration_draws_what_it_sees(make_collection: Any, tmp_path: Path) -> None:
    sensors = {"side": {"kind": "camera"}, "scan": {"kind": "lidar_2d"}}
    collected = make_collection({"trials": 1, "sensors": sensors}).collect(tmp_path / "a")
    pixels = picture(render(collected, tmp_path / "side.png", camera="side").file, 0)
    recorded = Dataset.open(collected)[0].sensors["side"].images
    # Its last frame is at most a tenth of a second older, and its edges are not smooth.
    assert np.abs(pixels - recorded[len(recorded) - 1].astype(int)).mean() < 2
    with pytest.raises(ConfigError, match=r"there is no camera scan\n.*side"):
        render(collected, tmp_path / "scan.png", camera="scan")
