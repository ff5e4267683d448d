"""Routes by which viewers get the scene, and the robot with its meshes."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from starlette.testclient import TestClient
from tests.unit.serve.conftest import Remember, Served

from throwcollect.robots.talos import TALOS

URL = "/api/v1/instances"


def test_the_scene_has_its_heights_and_the_range_of_targets(
    client: TestClient, remember: Remember, tmp_path: Path
) -> None:
    directory = tmp_path / "datasets" / "a"
    remember("a")
    assert client.get(f"{URL}/a/scene").status_code == 404
    directory.mkdir(parents=True)
    text = "name: a\ntrials: 3\nrobot: {base_height_m: 1.1}\nscene: {landing_height_m: 0.4}\n"
    (directory / "config.yaml").write_text(text)
    known = {"base_height_m": 1.1, "landing_height_m": 0.4, "target_distance_m": None}
    assert client.get(f"{URL}/a/scene").json() == known
    (directory / "config.yaml").write_text(f"""{text}sweep:
  parameters: {{scene.landing_height_m: {{min: 0.1, max: 0.5}}, task.duration_s: {{min: 0.9, max: 1.2}}}}
  target: {{distance_m: {{min: 0.5, max: 2.5, bins: 4}}}}
""")
    aimed = {"base_height_m": 1.1, "landing_height_m": None, "target_distance_m": [0.5, 2.5]}
    assert client.get(f"{URL}/a/scene").json() == aimed


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
