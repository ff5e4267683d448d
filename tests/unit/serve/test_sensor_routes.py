"""Routes by which clients get what sensors saw of a throw, and what another camera would have seen."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from starlette.testclient import TestClient
from tests.e2e.collection import FAST, collect_here, write_config
from tests.unit.serve.conftest import Remember, Served, make_end_fields

import throwcollect
from throwcollect import Dataset
from throwcollect.serve import sensor_routes
from throwcollect.state_directory import STATE_VARIABLE

URL = "/api/v1/collections/a/throws"
SENSORS = """
sensors:
  head: {kind: camera, link: head_2_link, position_m: [0.06, 0, 0.02], rpy_rad: [0, 0.3, 0], width: 16, height: 12,
    rate_hz: 2, streams: [segmentation, color, depth]}
  scan: {kind: lidar_2d, link: base_link, position_m: [0.4, 0, 0], rays: 36, rate_hz: 2}
  cloud: {kind: lidar_3d, link: base_link, position_m: [0.4, 0, 0.2], layers: 2, rays: 24, rate_hz: 2}
"""


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with a configuration that has sensors, and the dataset that it gives."""
    directory = tmp_path_factory.mktemp("seen")
    config = write_config(directory, trials=2, sim=FAST)
    config.write_text(config.read_text() + SENSORS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE_VARIABLE, str(directory / "state"))
        collect_here(config, directory / "data")
    return directory


@pytest.fixture
def dataset(seen: Path, tmp_path: Path, remember: Remember) -> Dataset:
    """A dataset with sensors, of a run that has ended."""
    shutil.copytree(seen / "data", tmp_path / "datasets" / "a")
    remember("a", **make_end_fields())
    return throwcollect.load(tmp_path / "datasets" / "a")


def test_frames_are_given_as_they_were_recorded(client: TestClient, dataset: Dataset) -> None:
    seen = dataset[1].sensors
    head, scan, cloud = client.get(f"{URL}/1/sensors").json()
    assert [each["name"] for each in (head, scan, cloud)] == ["head", "scan", "cloud"]
    assert (head["section"]["link"], head["position_m"]) == ("head_2_link", [0.06, 0, 0.02])
    assert head["streams"] == ["color", "depth", "segmentation"]
    # It looks down: x of the camera has a negative z.
    assert head["rotation_xyzw"] == pytest.approx([0, np.sin(0.15), 0, np.cos(0.15)])
    assert head["time_s"] == seen["head"].time_s.tolist()
    assert head["section"]["kind"] == "camera"
    assert head["section"]["rpy_rad"] == [0, 0.3, 0]

    def read(path: str, kind: str) -> np.ndarray[tuple[int], np.dtype[np.generic]]:
        answer = client.get(f"{URL}/1/sensors/{path}")
        assert answer.status_code == 200, answer.text
        return np.frombuffer(answer.content, kind)

    np.testing.assert_array_equal(read("head/color/2", "u1"), seen["head"].images[2].ravel())
    np.testing.assert_array_equal(read("head/depth/1", "<f4"), seen["head"].depth_m[1].ravel())
    np.testing.assert_array_equal(read("head/segmentation/0", "<u2"), seen["head"].labels[0].ravel())
    np.testing.assert_array_equal(read("scan/scan/1", "<f4"), seen["scan"].ranges[1])
    points = read("cloud/points/1", "<f4").reshape(2, 24, 4)
    for column, axis in enumerate("xyz"):
        np.testing.assert_array_equal(points[..., column], seen["cloud"].points[1][axis])


def test_what_is_not_there_is_not_found(client: TestClient, dataset: Dataset) -> None:
    for path in ("0/sensors/head/color/99", "0/sensors/head/scan/0", "0/sensors/nose/color/0", "9/sensors"):
        assert client.get(f"{URL}/{path}").status_code == 404, path


def test_another_camera_renders_the_picture_that_it_would_have_recorded(
    served: Served, client: TestClient, dataset: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[float] = []
    monkeypatch.setattr(sensor_routes, "time", SimpleNamespace(sleep=waits.append))
    camera = {"kind": "camera", "position_m": [1.2, -2, 1.5], "look_at_m": [0, 0, 1], "width": 24, "height": 16}
    answer = client.post(f"{URL}/0/picture", json={"camera": camera, "time_s": 0.5})
    assert answer.status_code == 200, answer.text
    about = json.loads(answer.headers["sensor"])
    assert (about["section"]["width"], about["position_m"], about["time_s"]) == (24, [1.2, -2, 1.5], [0.5])
    rendered = dataset[0].render({"other": {**camera, "rate_hz": 2}})["other"]
    np.testing.assert_array_equal(np.frombuffer(answer.content, "u1"), rendered.images[1].ravel())
    # Past the end, it is the picture of the last sample. Each waits, so that there are at most ten a second.
    late = client.post(f"{URL}/0/picture", json={"camera": camera, "time_s": 1e9})
    last = json.loads(late.headers["sensor"])["time_s"]
    assert last == [pytest.approx(dataset[0].joints.time_s[-1])]
    assert waits == [0.1, 0.1]
    for wrong in ({**camera, "link": "nose"}, {**camera, "width": 1}, {"kind": "lidar_2d", "rays": 4}):
        refused = client.post(f"{URL}/0/picture", json={"camera": wrong, "time_s": 0})
        assert (refused.status_code, "Traceback" in refused.text) == (422, False), refused.text
    only_looks = served.client(served.keys.read_only)
    assert only_looks.get(f"{URL}/0/sensors").status_code == 200
    assert only_looks.post(f"{URL}/0/picture", json={"camera": camera, "time_s": 0}).status_code == 403


def test_a_dataset_that_is_collected_anew_is_not_shown_as_it_was(
    client: TestClient, dataset: Dataset, seen: Path, tmp_path: Path
) -> None:
    assert client.get(f"{URL}/0/sensors").json()[0]["section"]["rate_hz"] == 2
    config = tmp_path / "small.yaml"
    config.write_text((seen / "small.yaml").read_text().replace("rate_hz: 2", "rate_hz: 5"))
    shutil.rmtree(dataset.directory)
    collect_here(config, dataset.directory)
    assert client.get(f"{URL}/0/sensors").json()[0]["section"]["rate_hz"] == 5


def test_a_throw_without_sensors_has_none(client: TestClient, collected: Path, remember: Remember) -> None:
    remember("a", directory=str(collected), **make_end_fields())
    assert client.get(f"{URL}/0/sensors").json() == []
