"""The directory for viewers: each throw as it was recorded, and the scene around it."""

from __future__ import annotations

import base64
import json
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from tests.unit.dataset.mcap_doctor import Examination

from rclzenoh.interfaces import deserialize, get_message
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import DatasetError
from throwcollect.publish.view.viewer_directory import View, view
from throwcollect.robots.talos import TALOS
from throwcollect.sensing.drawn_robot import draw_robot_of

CHOSEN = [5, 0]
SAMPLED = ["/tf", "/joint_states", "/ball/odometry"]

Messages = dict[str, list[tuple[int, Any]]]


def messages_of(path: Path) -> Messages:
    found: Messages = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            decoded = deserialize(message.data, get_message(schema.name))
            found.setdefault(channel.topic, []).append((message.log_time, decoded))
    return found


@pytest.fixture(scope="module")
def written(collected: Path, tmp_path_factory: pytest.TempPathFactory) -> View:
    return view(collected, tmp_path_factory.mktemp("view") / "view", CHOSEN)


@pytest.fixture(scope="module")
def messages(written: View) -> Messages:
    return messages_of(written.recording)


@pytest.fixture(scope="module")
def rows(collected: Path) -> list[dict[str, Any]]:
    return [Dataset.open(collected).throws.to_pylist()[trial] for trial in CHOSEN]


def fields(array: Any, *names: str) -> list[float]:
    return [getattr(array, name) for name in names]


def test_every_record_of_the_recording_is_sound(written: View) -> None:
    examined = Examination(written.recording)
    assert examined.times[-1] - examined.times[0] == round(written.duration_s * 1e9)


def test_the_view_directory_is_a_rosbag(written: View) -> None:
    with Reader(written.recording.parent) as bag:
        counts = {connection.topic: connection.msgcount for connection in bag.connections}
    assert {
        counts[topic] for topic in ("/robot_description", "/view/robot", "/view/tool", "/tf_static", "/view/throws")
    } == {1}
    assert {counts[topic] for topic in ("/view/throw", "/view/path")} == {len(CHOSEN)}
    assert len({counts[topic] for topic in SAMPLED}) == 1


def test_throws_follow_one_another_in_the_chosen_order(collected: Path, messages: Messages) -> None:
    dataset = Dataset.open(collected)
    states, odometry = messages["/joint_states"], messages["/ball/odometry"]
    start = 1_000_000_000
    for trial in CHOSEN:
        samples = dataset.episode(trial).samples()
        count = len(samples)
        stamps = samples.stamps_ns - samples.stamps_ns[0] + start
        assert [stamp for stamp, _ in states[:count]] == stamps.tolist()
        assert np.array_equal([state.position for _, state in states[:count]], samples.position)
        shown = [fields(state.pose.pose.position, *"xyz") for _, state in odometry[:count]]
        assert np.array_equal(shown, samples.object_position)
        assert odometry[0][1].header.stamp.sec * 10**9 + odometry[0][1].header.stamp.nanosec == start
        states, odometry = states[count:], odometry[count:]
        start = int(stamps[-1]) + 1_000_000_000
    assert not states


def test_every_shape_moves_with_an_existing_frame(messages: Messages) -> None:
    transforms = [each for topic in ("/tf", "/tf_static") for each in messages[topic][0][1].transforms]
    frames = {"world", *(each.child_frame_id for each in transforms)}
    topics = ("/view/robot", "/view/tool", "/view/throws")
    drawn = [marker for topic in topics for marker in messages[topic][0][1].markers]
    drawn += [marker for _, array in messages["/view/throw"] for marker in array.markers]
    assert {marker.header.frame_id for marker in drawn} <= frames
    moving = {marker.header.frame_id for marker in drawn if marker.frame_locked}
    assert {"ball", "spoon_link", "arm_right_7_link"} <= moving
    assert "world" not in moving


def test_the_recording_embeds_the_meshes_of_the_robot(messages: Messages) -> None:
    description = messages["/robot_description"][0][1]
    visuals = list(ElementTree.fromstring(description.data).iter("visual"))  # noqa: S314
    # The tool is the last link of the description.
    markers = [marker for part in ("robot", "tool") for marker in messages[f"/view/{part}"][0][1].markers]
    assert len(visuals) == len(markers) > 50
    for visual, marker in zip(visuals, markers, strict=True):
        mesh = visual.find("geometry/mesh")
        if mesh is None:
            assert (marker.type in (marker.CUBE, marker.CYLINDER), marker.mesh_resource) == (True, "")
            continue
        kind, _, content = marker.mesh_resource.partition(";base64,")
        path = TALOS.share() / mesh.attrib["filename"].removeprefix("package://")
        assert (marker.type, kind) == (marker.MESH_RESOURCE, "data:model/stl")
        assert base64.b64decode(content) == path.read_bytes()
        scale = [float(number) for number in mesh.get("scale", "1 1 1").split()]
        assert fields(marker.scale, *"xyz") == scale


def test_meshes_beside_the_recording_are_where_the_description_says(written: View, messages: Messages) -> None:
    description = messages["/robot_description"][0][1].data
    urls = set(re.findall(r'filename="package://([^"]+)"', description))
    directory = written.recording.parent
    assert len(urls) > 20
    assert all((directory / url).read_bytes() == (TALOS.share() / url).read_bytes() for url in urls)
    assert sum(file.stat().st_size for file in directory.rglob("*") if file.is_file()) == written.size_bytes
    for package in {url.split("/")[0] for url in urls}:
        assert ElementTree.parse(directory / package / "package.xml").findtext("name") == package  # noqa: S314
    assert "<collision" not in description


def test_points_of_a_throw_have_the_places_and_numbers_of_the_table(
    messages: Messages, rows: list[dict[str, Any]]
) -> None:
    for (_, array), row in zip(messages["/view/throw"], rows, strict=True):
        for name in ("release", "apex", "landing"):
            dot, label = [marker for marker in array.markers if marker.ns == name]
            assert fields(dot.pose.position, *"xyz") == [row[f"{name}_{axis}_m"] for axis in "xyz"]
            assert label.type == label.TEXT_VIEW_FACING
            assert label.text.startswith(name)
        assert f"x {row['landing_x_m']:.2f} m, y {row['landing_y_m']:.2f} m" in label.text


def test_the_layout_shows_only_topics_of_the_recording(written: View, messages: Messages) -> None:
    scene = json.loads(written.layout.read_text())["configById"]["3D!throws"]
    assert {*scene["topics"]} <= set(messages)
    assert scene["scene"]["meshUpAxis"] == "z_up"


def test_the_same_throws_give_the_same_bytes(collected: Path, written: View, tmp_path: Path) -> None:
    again = view(collected, tmp_path / "again", CHOSEN)
    assert again.recording.read_bytes() == written.recording.read_bytes()


def test_each_throw_is_shown_with_its_own_tool_and_ball(make_collection: Any, tmp_path: Path) -> None:
    swept = {"tool.handle_length_m": {"values": [0.15, 0.2]}, "ball.radius_m": {"values": [0.018, 0.02]}}
    dataset = make_collection({"trials": None, "sweep": {"sampler": "grid", "parameters": swept}}).collect(
        tmp_path / "a"
    )
    shown = messages_of(view(dataset, tmp_path / "view").recording)
    # Each of the four throws looks unlike the one before, but the robot without its tool is always the same.
    starts = [start for start, _ in shown["/view/throw"]]
    changing = ("/robot_description", "/view/object/robot_description", "/tf_static", "/view/tool")
    assert [[start for start, _ in shown[topic]] for topic in changing] == [starts] * 4
    assert len(shown["/view/robot"]) == 1
    plan = Dataset.open(dataset).plan
    for trial, (_, description), (_, ball) in zip(
        plan.trials, shown["/robot_description"], shown["/view/object/robot_description"], strict=True
    ):
        config = plan.config_of(trial)
        assert description.data == draw_robot_of(config).urdf
        assert f'radius="{config.ball.radius_m}"' in ball.data
    assert len({description.data for _, description in shown["/robot_description"]}) == 2


def test_bodies_are_shown_where_they_stand_in_each_throw(make_collection: Any, tmp_path: Path) -> None:
    pole = {"shape": "cylinder", "position_m": [1.0, 2.0, 0.5], "radius_m": 0.1, "length_m": 0.9, "color": "#ff8000"}
    swept = {"scene.bodies.pole.position_m.0": {"values": [1.0, 1.5]}}
    settings = {"trials": None, "scene": {"bodies": {"pole": pole}}, "sweep": {"sampler": "grid", "parameters": swept}}
    shown = messages_of(view(make_collection(settings).collect(tmp_path / "a"), tmp_path / "view").recording)
    found = [[each for each in array.markers if each.ns == "bodies"] for _, array in shown["/view/throw"]]
    assert [fields(each.pose.position, "x", "y", "z") for each, _ball in found] == [[1.0, 2.0, 0.5], [1.5, 2.0, 0.5]]
    ((marker, _), _) = found
    assert (marker.type, fields(marker.scale, "x", "y", "z")) == (marker.CYLINDER, [0.2, 0.2, 0.9])
    assert fields(marker.color, "r", "g", "b", "a") == pytest.approx([1.0, 128 / 255, 0.0, 1.0])
    assert (marker.header.frame_id, marker.action) == ("world", marker.ADD)


def hold_ball(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """The spoon keeps the ball."""
    contact = replace(header.contacts[0], end_ns=None)
    return samples, replace(header, contacts=(contact,), end_reason="timeout")


def test_a_throw_that_was_not_released_has_no_points(make_collection: Any, tmp_path: Path) -> None:
    dataset = make_collection({"trials": 1}).collect(tmp_path / "dataset", change=hold_ball)
    shown = messages_of(view(dataset, tmp_path / "view").recording)
    _, array = shown["/view/throw"][0]
    assert [marker.ns for marker in array.markers] == ["", "bodies", "path"]
    assert {round(color.g - color.r, 6) for color in array.markers[2].colors} == {0.0}


@pytest.mark.parametrize(
    ("trials", "message"),
    [
        ([0, 7], "no trial 7 among the 7 throws"),
        ([1, 2], "trial 2 has no episode: lost: two simulations were lost"),
    ],
)
def test_only_trials_with_an_episode_can_be_chosen(
    collection: Any, tmp_path: Path, trials: list[int], message: str
) -> None:
    dataset = collection.collect(tmp_path / "dataset", lost=[2])
    with pytest.raises(DatasetError, match=message):
        view(dataset, tmp_path / "view", trials)
    assert not (tmp_path / "view").exists()
