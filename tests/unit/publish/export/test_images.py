"""What sensors saw is exported frame by frame, with the stamps of the samples."""

from __future__ import annotations

import json
import pickle
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from tests.unit.publish.export.conftest import actions_of

import throwcollect
from throwcollect.config.loader import load
from throwcollect.dataset.derive.derivation import render_sensors
from throwcollect.dataset.sensors import SensorFrames
from throwcollect.dataset.throw import Throw
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.publish.export import images, npz
from throwcollect.publish.export.export import export

RATES = {"side": 25, "head": 10, "front": 10, "scan": 10}


def frames_of(throw: Throw, name: str, rate_hz: int, kind: str = "images") -> Any:
    frames: Any = getattr(throw.sensors[name], kind)[:: RATES[name] // rate_hz]
    return frames


def rows_of(directory: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = pq.read_table(directory / "meta" / "episodes").to_pylist()
    return rows


@pytest.mark.parametrize("way", ["av1", "h264"])
def test_videos_have_each_frame_at_its_time(way: str, seen: Path, tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    assert export(seen, tmp_path / "out", to="lerobot", images=way).rate_hz == 5
    info = json.loads((tmp_path / "out" / "meta" / "info.json").read_text())
    rows, throws = rows_of(tmp_path / "out"), throwcollect.load(seen)
    for name, (height, width) in {"side": (48, 64), "head": (32, 32)}.items():
        key = f"observation.images.{name}"
        feature = info["features"][key]
        assert (feature["dtype"], feature["shape"]) == ("video", [height, width, 3])
        assert feature["names"] == ["height", "width", "channels"]
        path = info["video_path"].format(video_key=key, chunk_index=0, file_index=0)
        with av.open(tmp_path / "out" / path) as file:
            stream = file.streams.video[0]
            described = (feature["info"]["video.codec"], feature["info"]["video.pix_fmt"])
            assert (stream.codec.canonical_name, stream.pix_fmt) == described
            decoded = list(file.decode(stream))
        assert [frame.pts * stream.time_base * 5 for frame in decoded] == list(range(info["total_frames"]))
        first = 0
        for row, throw in zip(rows, throws, strict=True):
            expected = frames_of(throw, name, 5)
            assert row["length"] == len(expected)
            assert row[f"videos/{key}/from_timestamp"] == first / 5
            first += len(expected)
            assert row[f"videos/{key}/to_timestamp"] == first / 5
            stored = [frame.to_ndarray(format="rgb24") for frame in decoded[first - len(expected) : first]]
            errors = np.abs(np.array(stored, float) - expected)
            # The noise of the head alone is 2.4, which is as much as a step of its motion.
            assert errors.mean(axis=(1, 2, 3)).max() < (4 if name == "head" else 2.5)
            if name == "side":
                assert errors.mean() < 0.8 * np.abs(np.array(stored[1:], float) - expected[:-1]).mean()
    assert not any("front" in name for name in info["features"])


def test_pictures_in_tables_are_exact_and_say_what_is_left_out(seen: Path, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    export(seen, tmp_path / "out", to="lerobot", images="png")
    info = json.loads((tmp_path / "out" / "meta" / "info.json").read_text())
    assert info["video_path"] is None
    assert info["features"]["observation.images.head"]["dtype"] == "image"
    table = pq.read_table(tmp_path / "out" / "data")
    for name in ("side", "head"):
        stored = [
            np.array(image.open(BytesIO(each["bytes"]))) for each in table[f"observation.images.{name}"].to_pylist()
        ]
        expected = np.concatenate([frames_of(throw, name, 5) for throw in throwcollect.load(seen)])
        assert np.array_equal(stored, expected)
    card = (tmp_path / "out" / "README.md").read_text()
    assert "recorded: `front` depth; `head` color; `scan` scan; `side` color, depth. " in card
    assert "here is: `head` color; `side` color; named `observation.images.<sensor>`, depths `" in card


def test_depths_in_tables_are_those_of_throws_in_mm(seen: Path, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    export(seen, tmp_path / "out", to="lerobot", images="depth")
    info = json.loads((tmp_path / "out" / "meta" / "info.json").read_text())["features"]
    statistics = json.loads((tmp_path / "out" / "meta" / "stats.json").read_text())
    table = pq.read_table(tmp_path / "out" / "data")
    assert [name for name in info if "images" in name] == [
        f"observation.images.{name}" for name in ("side", "side_depth", "head", "front_depth")
    ]
    for name, shape in (("side", [48, 64, 1]), ("front", [12, 16, 1])):
        key = f"observation.images.{name}_depth"
        assert (info[key]["shape"], info[key]["info"]) == (shape, {"is_depth_map": True, "depth_unit": "mm"})
        opened = [image.open(BytesIO(each["bytes"])) for each in table[key].to_pylist()]
        assert {each.mode for each in opened} == {"I;16"}
        stored = np.array([*map(np.array, opened)])
        depth_m = np.concatenate([frames_of(throw, name, 5, "depth_m") for throw in throwcollect.load(seen)])
        assert np.array_equal(stored == 0, np.isinf(depth_m))
        assert np.abs(stored / 1000 - np.where(stored, depth_m, 0)).max() < 0.00051
        for measure in ("min", "max", "mean", "std"):
            found = np.array(statistics[key][measure])
            np.testing.assert_allclose(found, getattr(np, measure)(stored).reshape(1, 1, 1), rtol=1e-12)


def test_statistics_of_images_are_those_of_all_pixels_but_for_quantiles(seen: Path, tmp_path: Path) -> None:
    export(seen, tmp_path / "out", to="lerobot", images="png")
    statistics = json.loads((tmp_path / "out" / "meta" / "stats.json").read_text())["observation.images.side"]
    throws = [frames_of(throw, "side", 5) for throw in throwcollect.load(seen)]
    rows = rows_of(tmp_path / "out")
    of_episodes = [{key: row[f"stats/observation.images.side/{key}"] for key in statistics} for row in rows]
    counts = [len(frames) for frames in throws]
    for found, frames in [(statistics, np.concatenate(throws)), *zip(of_episodes, throws, strict=True)]:
        pixels = frames.reshape(-1, 3) / 255
        expected = {"min": pixels.min(0), "max": pixels.max(0), "mean": pixels.mean(0), "std": pixels.std(0)}
        for percent in (1, 10, 50, 90, 99):
            expected[f"q{percent:02d}"] = np.quantile(pixels, percent / 100, axis=0, method="inverted_cdf")
            if found is statistics:
                means = np.average([each[f"q{percent:02d}"] for each in of_episodes], 0, counts)
                expected[f"q{percent:02d}"] = means.ravel()
        for key, values in expected.items():
            np.testing.assert_allclose(found[key], values.reshape(3, 1, 1), atol=1e-12, err_msg=key)
        assert found["count"] == [len(frames)]


def test_videos_end_where_they_are_full(seen: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    av = pytest.importorskip("av")
    # Two throws have more than two seconds.
    monkeypatch.setattr(images, "_LONGEST_S", 2)
    monkeypatch.setattr(images, "FILES_PER_CHUNK", 1)
    export(seen, tmp_path / "out", to="lerobot", images="h264")
    places = []
    for row in rows_of(tmp_path / "out"):
        key = "videos/observation.images.head"
        places.append((row[f"{key}/chunk_index"], row[f"{key}/file_index"], row[f"{key}/from_timestamp"]))
    length = rows_of(tmp_path / "out")[0]["length"]
    assert places == [(0, 0, 0), (0, 0, length / 5), (1, 0, 0)]
    last = rows_of(tmp_path / "out")[2]
    with av.open(tmp_path / "out" / key / "chunk-001" / "file-000.mp4") as file:
        assert len(list(file.decode(video=0))) == last["length"]


def test_hdf5_has_images_and_depths_as_robomimic_reads_them(seen: Path, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    export(seen, tmp_path / "out", to="hdf5")
    # This is how robomimic opens files.
    with h5py.File(tmp_path / "out" / "throws.hdf5", "r", swmr=True, libver="latest") as file:
        for throw in throwcollect.load(seen):
            demo = file[f"data/demo_{throw.trial}"]
            assert demo["obs"].keys() == demo["next_obs"].keys()
            for name, kind, ending in [
                ("side", "images", "image"),
                ("side", "depth_m", "depth"),
                ("head", "images", "image"),
                ("front", "depth_m", "depth"),
            ]:
                expected = frames_of(throw, name, 5, kind).reshape(demo.attrs["num_samples"], 1, -1)
                for group, frames in (("obs", expected), ("next_obs", [*expected[1:], expected[-1]])):
                    stored = demo[f"{group}/{name}_{ending}"]
                    assert stored.dtype == (np.uint8 if kind == "images" else np.float32)
                    assert stored.shape[3] == (3 if kind == "images" else 1)
                    assert np.array_equal(stored[:].reshape(len(stored), 1, -1), frames)
                    assert stored.attrs["unit"] == ("1" if kind == "images" else "m")
                    assert ("One sample later" in stored.attrs["description"]) == (group == "next_obs")
                assert demo[f"obs/{name}_{ending}"].chunks[0] == 1
        assert "head_depth" not in demo["obs"]


def test_archives_have_all_streams_when_asked(seen: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    export(seen, tmp_path / "out", to="npz", images="arrays")
    for number, throw in enumerate(throwcollect.load(seen)):
        archive = np.load(tmp_path / "out" / "trajectories" / f"seen_{number // 2:05d}.npz")
        rows = slice(*archive["offsets"][number % 2 :][:2])
        assert np.array_equal(archive["time_s"][rows], throw.sensors["side"].time_s[::5])
        for name, kind in [("side", "images"), ("side", "depth_m"), ("front", "depth_m"), ("scan", "ranges")]:
            assert np.array_equal(archive[f"{name}_{kind}"][rows], frames_of(throw, name, 5, kind))
    export(seen, tmp_path / "without", to="npz")
    assert not any("side" in name for name in np.load(tmp_path / "without" / "trajectories" / "seen_00000.npz"))
    monkeypatch.setattr(npz, "_LARGEST", 2**10)
    with pytest.raises(ConfigError, match=r"front_depth_m of one recording would have 0\.0 GiB"):
        export(seen, tmp_path / "large", to="npz", images="arrays")
    assert not (tmp_path / "large").exists()


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"to": "lerobot", "rate_hz": 50}, "50 samples per second of joints at 250 Hz, head at 10 Hz, side at 25 Hz"),
        ({"to": "mat", "images": "arrays"}, "mat has no 'arrays'"),
        ({"to": "hdf5", "images": "png"}, "hdf5 has no 'png'"),
    ],
)
def test_images_that_cannot_be_exported_are_refused(
    settings: dict[str, Any], problem: str, seen: Path, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=problem):
        export(seen, tmp_path / "out", **settings)
    assert not (tmp_path / "out").exists()


def test_videos_need_even_numbers_of_pixels_and_images_a_sensor(seen: Path, source: Path, tmp_path: Path) -> None:
    sections = load(seen.parent / "config.yaml").sensors
    render_sensors(seen, tmp_path / "odd", {"head": sections["head"].model_copy(update={"width": 33})})
    with pytest.raises(ConfigError, match="av1 of the 33 x 32 pixels of head"):
        export(tmp_path / "odd", tmp_path / "out", to="lerobot")
    export(tmp_path / "odd", tmp_path / "out", to="lerobot", images="png")
    with pytest.raises(ConfigError, match="has no sensors that lerobot has images of"):
        export(source, tmp_path / "blind", to="lerobot", images="png")


def test_a_throw_that_lacks_frames_is_found(seen: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stamps = SensorFrames.stamps_ns.func
    monkeypatch.setattr(SensorFrames, "stamps_ns", property(lambda self: stamps(self)[:-5]))
    with pytest.raises(DatasetError, match=r"trial 0: front has \d+ frames, and there are more or fewer samples"):
        export(seen, tmp_path / "out", to="hdf5")


def test_frames_for_training_are_those_of_throws_with_their_signals_and_actions(seen: Path) -> None:
    frames = pickle.loads(pickle.dumps(throwcollect.FrameDataset(seen, horizon=3)))  # noqa: S301
    throws = throwcollect.load(seen)
    lengths = [len(throw.sensors["head"].images[::2]) for throw in throws]
    assert len(frames) == sum(lengths)
    number = 0
    for throw, length, actions in zip(throws, lengths, actions_of(seen, 50), strict=True):
        for at in range(length):
            frame = frames[number]
            number += 1
            assert np.array_equal(frame["side_image"], throw.sensors["side"].images[at * 5])
            assert np.array_equal(frame["front_depth"][:, :, 0], throw.sensors["front"].depth_m[at * 2])
            assert np.array_equal(frame["joint_velocity_radps"], throw.joints.velocity[at * 50].astype(np.float32))
            expected = actions[[at, min(at + 1, length - 1), min(at + 2, length - 1)]]
            np.testing.assert_allclose(frame["action"], expected, atol=1e-6)
            assert (frame["trial"], frame["time_s"].shape) == (throw.trial, (1,))
    assert number == len(list(frames))
    assert frames[-1]["trial"] == 2


def test_frames_for_training_have_what_is_observed_at_the_rate_of_its_cameras(seen: Path) -> None:
    throws = throwcollect.load(seen)[1:]
    frames = throwcollect.FrameDataset(throws, observation=["side_image", "ball_position_m"])
    assert frames[7].keys() == {"side_image", "ball_position_m", "action", "trial"}
    assert np.array_equal(frames[7]["side_image"], throws[0].sensors["side"].images[7])
    assert np.array_equal(frames[7]["ball_position_m"], throws[0].ball.position[70].astype(np.float32))
    for name in frames[7].keys() - {"trial"}:
        changed, before = frames[7][name], frames[7][name]
        changed += 1
        assert np.array_equal(frames[7][name], before), name
    with pytest.raises(ConfigError, match="horizon: got -1"):
        throwcollect.FrameDataset(seen, horizon=-1)
    with pytest.raises(ConfigError, match=r"observation: there is no 'side_imag'; did you mean 'side_image'\?"):
        throwcollect.FrameDataset(seen, observation=["side_imag"])
    with pytest.raises(ConfigError, match=r"side at 25 Hz\n  expected: a divisor of 25$"):
        throwcollect.FrameDataset(seen, observation=["side_image"], rate_hz=10)
