"""Datasets with sensors: what is recorded of them, how it is read, and that it follows from the samples alone."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import throwcollect
from throwcollect import runs
from throwcollect.config.loader import load
from throwcollect.dataset.derive.derivation import filter_trials, merge, render_sensors
from throwcollect.dataset.sensors import SensorFrames
from throwcollect.dataset.verify import verify
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.replay import verify_dataset
from throwcollect.sensing.camera import Frame
from throwcollect.sensing.noise import Noise
from throwcollect.sensing.scene import PlacedScene
from throwcollect.sensing.sensor import CameraSensor

CONFIG = """\
name: seen
trials: 3
seed: 4
sim: {{engine: ballistic}}
record: {{trials_per_shard: 2, topics: [joint_states, ball/odometry{topics}]}}
run: {{replay: 0}}
sweep: {{sampler: uniform, parameters: {{task.duration_s: {{min: 1.0, max: 1.2}}{swept}}}}}
{sensors}"""
SENSORS = """\
sensors:
  side:
    kind: camera
    width: 192
    height: 144
    rate_hz: 5
    streams: [segmentation, color, depth]
    depth_encoding: 32FC1
  head:
    kind: depth
    link: head_2_link
    position_m: [0.1, 0, 0]
    rpy_rad: [0, 1.2, 0]
    width: 16
    height: 12
    noise: {depth_std_m: 0.01, dropout: 0.25}
  scan: {kind: lidar_2d, link: base_link, position_m: [0.4, 0, 0], rays: 36, rate_hz: 2, latency_s: 0.1}
  cloud: {kind: lidar_3d, link: base_link, position_m: [0.4, 0, 0.2], layers: 4, rays: 24, rate_hz: 2}
"""
SWEPT = ", sensors.side.vertical_fov_rad: {min: 0.8, max: 1.2}, sensors.head.position_m.0: {min: 0.1, max: 0.12}"


def collect(directory: Path, sensors: str, *, swept: str = "", topics: str = "") -> Path:
    config = directory / "config.yaml"
    config.parent.mkdir(exist_ok=True, parents=True)
    config.write_text(CONFIG.format(sensors=sensors, swept=swept, topics=topics))
    with runs.prepare(config, overrides=["run.runtime=inprocess"], output=directory / "data") as run:
        run.collect()
    return directory / "data"


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return collect(tmp_path_factory.mktemp("seen"), SENSORS)


@pytest.fixture(scope="module")
def blind(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return collect(tmp_path_factory.mktemp("blind"), "")


def sections(directory: Path) -> Mapping[str, Any]:
    return load(directory.parent / "config.yaml").sensors


def test_streams_are_arrays_with_stamps_of_samples(seen: Path) -> None:
    throw = throwcollect.load(seen)[1]
    side, head, scan, cloud = (throw.sensors[name] for name in ("side", "head", "scan", "cloud"))
    assert list(throw.sensors) == ["side", "head", "scan", "cloud"]
    samples = throw.read_samples()[1]
    for sensor, rate_hz in ((side, 5), (head, 10), (scan, 2), (cloud, 2)):
        assert sensor.stamps_ns.tolist() == samples.stamps_ns[:: 250 // rate_hz].tolist()
        assert sensor.time_s[1] == 1 / rate_hz
    assert (side.images[0].shape, side.images[:].dtype) == ((144, 192, 3), np.uint8)
    assert (side.depth_m[-1].shape, side.depth_m[0].dtype, side.labels[0].dtype) == ((144, 192), np.float32, np.uint16)
    assert (scan.ranges[0].shape, cloud.points[0].shape, len(side.images), len(side)) == ((36,), (4, 24), 8, 8)
    assert side.label_names[0] == "background"
    assert {"background", "ball", "ground", "arm_right_4_link"} <= {
        side.label_names[number] for number in np.unique(side.labels[:])
    }
    assert np.isinf(side.depth_m[0][side.labels[0] == 0]).all()
    # Seen from the base, which stands upright, the ground is level.
    ground = cloud.label_names.index("ground")
    points = cloud.points[0][cloud.points[0]["intensity"] == ground]
    assert len(points) > 10
    assert np.ptp(points["z"]) < 1e-5
    with pytest.raises(DatasetError, match="head has no stream color"):
        _ = head.images
    with pytest.raises(IndexError):
        _ = side.images[8]


def test_intrinsics_and_poses_put_the_ball_where_the_segmentation_has_it(seen: Path) -> None:
    throw = throwcollect.load(seen)[0]
    side = throw.sensors["side"]
    ball = side.label_names.index("ball")
    for number in (5, 6):
        rows, columns = np.nonzero(side.labels[number] == ball)
        x, y, z, _ = np.linalg.inv(side.poses[number]) @ (*throw.ball.position[number * 50], 1)
        u, v, depth = side.intrinsics @ (x, y, z)
        assert abs(columns.mean() - u / depth) < 0.7
        assert abs(rows.mean() - v / depth) < 0.7
        assert abs(side.depth_m[number][rows[0], columns[0]] - depth) < 0.03


def test_poses_of_sensors_on_a_link_follow_it(seen: Path) -> None:
    throw = throwcollect.load(seen)[0]
    hand = {"link": "arm_right_7_link", "position_m": [0.3, 0, 0], "rate_hz": 5}
    lidar = {"kind": "lidar_3d", "layers": 8, "rays": 64, "vertical_rad": [-1.5, 1.5], **hand}
    camera, cloud = throw.render({"eye": {"kind": "camera", **hand}, "cloud": lidar}).values()
    ground = cloud.label_names.index("ground")
    for number in (0, 4, 5):
        points = cloud.points[number][cloud.points[number]["intensity"] == ground]
        assert len(points) > 10
        at = cloud.poses[number] @ (points["x"], points["y"], points["z"], np.ones(len(points)))
        assert np.abs(at[2]).max() < 1e-5
    # The lens looks along x of the link, with y to its left and z upwards.
    assert np.array_equal(camera.poses[4][:3, :3], cloud.poses[4][:3, :3] @ [[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    assert np.array_equal(camera.poses[:][..., 3], cloud.poses[:][..., 3])
    assert camera.poses[:].shape == (len(camera), 4, 4)
    assert np.ptp(camera.poses[:][:, 0, 3]) > 0.1


def test_noise_is_added_on_reading_and_the_same_each_time(seen: Path, tmp_path: Path) -> None:
    throws = [throwcollect.load(seen)[number] for number in (0, 0, 1)]
    first, again, other = (throw.sensors["head"].depth_m[2] for throw in throws)
    clean = throws[0].sensors["head"]
    clean.noise = False
    assert np.array_equal(first, again, equal_nan=True)
    assert not np.array_equal(first, other, equal_nan=True)
    assert np.isfinite(clean.depth_m[2]).all()
    assert 0.1 < np.isnan(first).mean() < 0.4
    assert 0.005 < np.nanstd(first - clean.depth_m[2]) < 0.02
    recorded = SENSORS.replace("dropout: 0.25", "dropout: 0.25, recorded: true")
    noisy = throwcollect.load(collect(tmp_path, recorded))[0].sensors["head"]
    assert np.nanmax(np.abs(noisy.depth_m[2] - first)) <= 0.0011
    assert np.isinf(noisy.depth_m[2][np.isnan(first)]).all()


@pytest.mark.parametrize("kind", [{"kind": "lidar_2d"}, {"kind": "lidar_3d", "layers": 4}])
def test_lidars_have_their_noise_whether_it_is_recorded_or_added_on_reading(seen: Path, kind: dict[str, Any]) -> None:
    def measure(**noise: Any) -> Any:
        section = {"link": "base_link", "position_m": [0.4, 0, 0.2], "rays": 180, "rate_hz": 2, **kind, "noise": noise}
        found = throwcollect.load(seen)[0].render({"lidar": section})["lidar"]
        if kind["kind"] == "lidar_2d":
            return np.where(np.isinf(found.ranges[2]), np.nan, found.ranges[2])
        return np.sqrt(sum(found.points[2][axis] ** 2 for axis in "xyz"))

    clean, read = measure(), measure(range_std_m=0.02, dropout=0.1)
    np.testing.assert_allclose(read, measure(range_std_m=0.02, dropout=0.1, recorded=True), rtol=1e-5)
    assert 0.05 < np.isnan(read)[np.isfinite(clean)].mean() < 0.15
    assert 0.015 < np.nanstd(read - clean) < 0.025


def test_normal_noise_is_normal() -> None:
    noise = Noise(load_noise(color_std=5), 1, 2, "head/color")
    drawn = noise.color(np.full((200, 200, 3), 128, np.uint8), 3).astype(float)
    assert abs(drawn.mean() - 128) < 0.1
    assert abs(drawn.std() - 5) < 0.1


def test_noise_makes_no_distance_negative() -> None:
    noise = Noise(load_noise(depth_std_m=0.5), 1, 2, "head/depth")
    drawn = noise.distance(np.array([[0.01, np.inf]] * 500, np.float32), 0)
    assert (drawn[:, 0] == 0).sum() > 200
    assert drawn[:, 0].max() > 0.5
    assert np.isposinf(drawn[:, 1]).all()


def load_noise(**keys: float) -> Any:
    from throwcollect.config.sensors import CameraNoise

    return CameraNoise(**keys)


def test_sensors_change_no_throw_and_can_be_added_and_changed_later(seen: Path, blind: Path, tmp_path: Path) -> None:
    assert throwcollect.load(seen).digest == throwcollect.load(blind).digest
    assert verify(seen) == []
    added = render_sensors(blind, tmp_path / "added", sections(seen))
    assert (added.trials, added.digest) == (3, throwcollect.load(blind).digest)
    for name in ("seen_00000.mcap", "seen_00001.mcap"):
        assert (tmp_path / "added" / name).read_bytes() == (seen / name).read_bytes()
    assert verify(tmp_path / "added") == []
    render_sensors(seen, tmp_path / "removed", {})
    assert (tmp_path / "removed" / "seen_00000.mcap").read_bytes() == (blind / "seen_00000.mcap").read_bytes()
    # Frames of a dataset without them are rendered when somebody looks.
    [rendered] = throwcollect.load(blind)[2].render({"side": sections(seen)["side"]}).values()
    assert np.array_equal(rendered.images[:], throwcollect.load(seen)[2].sensors["side"].images[:])
    with pytest.raises(
        ConfigError, match=r"sensors\.side\.link: there is no link 'hed_2_link'; did you mean 'head_2_link'"
    ):
        throwcollect.load(blind)[2].render({"side": {"kind": "camera", "link": "hed_2_link"}})


def test_derived_datasets_keep_their_sensors(seen: Path, blind: Path, tmp_path: Path) -> None:
    filter_trials(seen, tmp_path / "late", where="trial >= 1")
    late = throwcollect.load(tmp_path / "late")
    assert np.array_equal(late[0].sensors["side"].images[:], throwcollect.load(seen)[1].sensors["side"].images[:])
    assert verify(tmp_path / "late") == []
    filter_trials(blind, tmp_path / "first", where="trial < 1")
    with pytest.raises(ConfigError, match="different sensors"):
        merge([tmp_path / "late", tmp_path / "first"], tmp_path / "all")


def test_swept_cameras_have_their_own_intrinsics_and_places(tmp_path: Path) -> None:
    directory = collect(tmp_path, SENSORS, swept=SWEPT, topics=", tf")
    dataset = throwcollect.load(directory)
    focal = [throw.sensors["side"].intrinsics[0, 0] for throw in dataset]
    assert focal == pytest.approx([72 / np.tan(throw["sensors_side_vertical_fov_rad"] / 2) for throw in dataset])
    assert len(set(focal)) == 3
    assert verify(directory) == []
    store = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([directory], default_typestore=store) as reader:
        infos, places = [], []
        for connection, _, message in reader.messages():
            if connection.topic == "/side/camera_info":
                infos.append(float(reader.deserialize(message, connection.msgtype).k[0]))
            if connection.topic == "/tf":
                [*_, last] = reader.deserialize(message, connection.msgtype).transforms
                if last.child_frame_id == "head_frame":
                    places.append(last.transform.translation.x)
    assert sorted(set(infos)) == sorted(focal)
    assert sorted(set(places)) == sorted(throw["sensors_head_position_m_0"] for throw in dataset)


def test_files_are_bags_and_messages_have_the_frames_of_ros(seen: Path) -> None:
    with (seen / "seen_00000.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        arrivals = {
            channel.topic: (message.log_time - message.publish_time) / 1e9
            for _, channel, message in reader.iter_messages()
        }
    assert arrivals["/scan/scan"] == pytest.approx(0.1)
    assert arrivals["/side/image_raw"] == 0
    with AnyReader([seen], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        frames, labels, fixed = {}, [], {}
        for connection, stamp, message in reader.messages():
            if connection.msgtype in (
                "sensor_msgs/msg/Image",
                "sensor_msgs/msg/PointCloud2",
                "sensor_msgs/msg/LaserScan",
            ):
                read = reader.deserialize(message, connection.msgtype)
                frames[connection.topic] = read.header.frame_id, getattr(read, "encoding", "")
                assert stamp >= read.header.stamp.sec * 10**9 + read.header.stamp.nanosec
            if connection.topic == "/side/segmentation/labels":
                labels = list(json.loads(reader.deserialize(message, connection.msgtype).data).values())
            if connection.topic == "/tf_static":
                for each in reader.deserialize(message, connection.msgtype).transforms:
                    fixed[each.child_frame_id] = each.header.frame_id
    assert frames == {
        "/side/image_raw": ("side_optical_frame", "rgb8"),
        "/side/depth/image_raw": ("side_optical_frame", "32FC1"),
        "/side/segmentation/image_raw": ("side_optical_frame", "mono16"),
        "/head/depth/image_raw": ("head_optical_frame", "16UC1"),
        "/scan/scan": ("scan_frame", ""),
        "/cloud/points": ("cloud_frame", ""),
    }
    assert tuple(labels) == throwcollect.load(seen)[0].sensors["side"].label_names
    assert fixed["side_optical_frame"] == "side_frame"


@pytest.mark.parametrize("place", ["pixel", "index"])
def test_damage_of_a_frame_is_found(seen: Path, tmp_path: Path, place: str) -> None:
    directory = tmp_path / "data"
    shutil.copytree(seen, directory)
    path = directory / "seen_00000.mcap"
    data = bytearray(path.read_bytes())
    row = throwcollect.load(directory)[0].row
    episode = throwcollect.load(directory)[0].read_episode(sensors=True)
    chunk = episode.sensors[-1]
    record = bytes(chunk.data) if place == "pixel" else next(iter(chunk.indexes.values()))
    at = data.index(record, row["chunk_offset"]) + len(record) // 2
    data[at] ^= 1
    path.write_bytes(data)
    assert [finding.file for finding in verify(directory)][:1] == ["seen_00000.mcap"]
    frames = throwcollect.load(directory)[0].sensors["side"]
    assert isinstance(frames, SensorFrames)
    if place == "pixel":
        with pytest.raises(DatasetError, match="chunk"):
            _ = frames.images[:]


def test_a_changed_pixel_with_fitting_hashes_is_found_by_rendering_again(
    seen: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    see = CameraSensor.see

    def see_falsely(self: CameraSensor, placed: PlacedScene) -> Frame:
        frame = see(self, placed)
        if frame.color is not None:
            frame.color[0, 0, 0] ^= 1
        return frame

    with monkeypatch.context() as patch:
        patch.setattr(CameraSensor, "see", see_falsely)
        render_sensors(seen, tmp_path / "forged", {"side": sections(seen)["side"]})
    assert verify(tmp_path / "forged") == []
    findings = verify_dataset(tmp_path / "forged", replay=0, render=3)
    assert [finding.place for finding in findings] == ["trial 0", "trial 1", "trial 2"]
    assert findings[0].problem == "has other frames of side than its samples give"
    assert verify_dataset(seen, replay=0, render=1) == []
