"""Routes by which viewers get the scene, and the robot with its meshes."""

from __future__ import annotations

import hashlib
import re
import shutil
from pathlib import Path
from typing import Any

from starlette.testclient import TestClient
from tests.unit.serve.conftest import Remember, Served

from throwcollect.config.loader import load
from throwcollect.dataset.carried_robot import write_config
from throwcollect.robots.talos import TALOS

CONFIGS = Path(__file__).parents[3] / "configs"
URL = "/api/v1/instances"
PARTS = ("floor", "front", "back", "right", "left")


def read_scene(client: TestClient) -> dict[str, Any]:
    scene = client.get(f"{URL}/a/scene").json()
    return {**scene, "bodies": [each["name"] for each in scene["bodies"]]}


def test_the_scene_has_its_heights_and_the_range_of_targets(
    client: TestClient, remember: Remember, tmp_path: Path
) -> None:
    directory = tmp_path / "datasets" / "a"
    remember("a")
    assert client.get(f"{URL}/a/scene").status_code == 404
    directory.mkdir(parents=True)
    text = "name: a\ntrials: 3\nrobot: {base_height_m: 1.1}\nscene: {landing_height_m: 0.4}\n"
    (directory / "config.yaml").write_text(text)
    plain = {"mount_height_m": 0, "bodies": ["ball"]}
    known = {"base_height_m": 1.1, "landing_height_m": 0.4, "target_distance_m": None, **plain}
    assert read_scene(client) == known
    (directory / "config.yaml").write_text(f"""{text}sweep:
  parameters: {{scene.landing_height_m: {{min: 0.1, max: 0.5}}, task.duration_s: {{min: 0.9, max: 1.2}}}}
  target: {{distance_m: {{min: 0.5, max: 2.5, bins: 4}}}}
""")
    aimed = {"base_height_m": 1.1, "landing_height_m": None, "target_distance_m": [0.5, 2.5], **plain}
    assert read_scene(client) == aimed
    (directory / "config.yaml").write_text((CONFIGS / "panda.yaml").read_text())
    arm = {**known, "base_height_m": 0.8, "mount_height_m": 0.8, "landing_height_m": 0.0}
    assert read_scene(client) == arm


def test_the_scene_has_the_bodies_of_scene_and_task(client: TestClient, remember: Remember, tmp_path: Path) -> None:
    remember("a")
    directory = tmp_path / "datasets" / "a"
    directory.mkdir(parents=True)
    pole = "pole: {shape: cylinder, position_m: [1, 2, 0.5], rpy_rad: [0, 0.5, 0], radius_m: 0.1, length_m: 1}"
    (directory / "config.yaml").write_text(f"task: {{name: throw_into, wall: {{}}}}\nscene: {{bodies: {{{pole}}}}}\n")
    bodies = client.get(f"{URL}/a/scene").json()["bodies"]
    assert [each["name"] for each in bodies] == ["pole", *(f"bin_{part}" for part in PARTS), "wall", "ball"]
    outlines = {name: bodies[0].pop(name) for name in ("above_m", "side_m")}
    assert bodies[0] == {
        "name": "pole",
        "shape": "cylinder",
        "size_m": [0.2, 0.2, 1.0],
        "position_m": [1.0, 2.0, 0.5],
        "rpy_rad": [0.0, 0.5, 0.0],
        "color": "#8a6f4d",
        "moves": False,
        "mesh": "",
        "within": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    }
    assert all(len(corner) == 2 for outline in outlines.values() for corner in outline)


def test_meshes_can_be_fetched_by_digest_and_cached_for_ever(
    client: TestClient, remember: Remember, tmp_path: Path
) -> None:
    directory = tmp_path / "datasets" / "a"
    directory.mkdir(parents=True)
    (directory / "config.yaml").write_text("name: small\n")
    remember("a")
    meshes = client.get(f"{URL}/a/meshes").json()
    named = set(re.findall(r'package://[^"]+', client.get(f"{URL}/a/urdf").text))
    assert {each["url"] for each in meshes} == named
    for each in (meshes[0], meshes[-1]):
        found = client.get(f"/api/v1/meshes/{each['sha256']}")
        assert (hashlib.sha256(found.content).hexdigest(), len(found.content)) == (each["sha256"], each["bytes"])
        assert "immutable" in found.headers["cache-control"]
        assert found.content == client.get(f"/api/v1/meshes/{each['url'].removeprefix('package://')}").content
    assert client.get(f"/api/v1/meshes/{64 * '0'}").status_code == 404
    assert client.get(f"{URL}/nobody/meshes").status_code == 404


def test_meshes_come_only_from_packages_of_robots(served: Served) -> None:
    client = served.client()
    base = "/api/v1/meshes"
    mesh = "example-robot-data/robots/talos_data/meshes/head/head_1.stl"
    assert client.get(f"{base}/{mesh}").content == (TALOS.share() / mesh).read_bytes()
    for path in (
        "../x",
        "..%2f..%2fsetup.py",
        "%2e%2e/x",
        "nothing/x",
        "%00/x",
        "a/%00",
        f"a/{300 * 'a'}",
        "%2fetc/passwd",
    ):
        assert client.get(f"{base}/{path}").status_code == 404, path


def test_a_robot_is_drawn_from_the_dataset_that_carries_it(
    client: TestClient, remember: Remember, state: Path, tmp_path: Path
) -> None:
    directory = tmp_path / "datasets" / "a"
    directory.mkdir(parents=True)
    (tmp_path / "panda.yaml").write_text(
        "trials: 3\nrobot: {name: panda}\ntask: {start: {panda_joint4: -2.0}, end: {panda_joint4: -1.0}}\n"
    )
    write_config(directory, load(tmp_path / "panda.yaml"))
    shutil.rmtree(state / "robots")
    remember("a", lives=False)
    urls = set(re.findall(r'package://[^"]+', client.get(f"{URL}/a/urdf").text))
    found = {url: client.get(f"/api/v1/meshes/{url.removeprefix('package://')}") for url in urls}
    assert len(urls) > 10
    assert {each.status_code for each in found.values()} == {200}
    meshes = client.get(f"{URL}/a/meshes").json()
    assert {each["url"] for each in meshes} == urls
    for each in meshes:
        content = client.get(f"/api/v1/meshes/{each['sha256']}").content
        assert (content, hashlib.sha256(content).hexdigest()) == (found[each["url"]].content, each["sha256"])


def test_nothing_outside_of_the_directory_of_a_carried_robot_is_served(
    client: TestClient, remember: Remember, tmp_path: Path
) -> None:
    robot = tmp_path / "datasets" / "a" / "robot"
    robot.mkdir(parents=True)
    (tmp_path / "secret").write_text("secret")
    own, linked = f"{16 * '0'}.stl", f"{16 * '1'}.stl"
    (robot / own).write_text("own")
    (robot / linked).symlink_to(tmp_path / "secret")
    remember("a", lives=False)
    assert client.get(f"/api/v1/meshes/any/{own}").text == "own"
    secret = hashlib.sha256(b"secret").hexdigest()
    (robot / f"{secret[:16]}.stl").symlink_to(tmp_path / "secret")
    for name in (f"any/{linked}", "any/..%2fconfig.yaml", f"any/{tmp_path}/secret", secret):
        assert client.get(f"/api/v1/meshes/{name}").status_code == 404, name
