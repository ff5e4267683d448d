"""Bodies whose shapes are in files, on the page: who may name files, what is served, and how it is drawn."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from starlette.testclient import TestClient
from tests.unit.robots.test_body_files import write_box
from tests.unit.serve.conftest import Remember

from throwcollect.config.loader import load
from throwcollect.dataset.carried_robot import write_config
from throwcollect.serve import app

URL = "/api/v1/instances"


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node, which runs modules without a browser")
def test_the_page_draws_bodies_of_several_shapes() -> None:
    environment = {**os.environ, "PAGE": str(Path(app.__file__).parent / "page"), "NODE_OPTIONS": ""}
    command = ["node", "--test", str(Path(__file__).with_name("page_bodies.mjs"))]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout


def test_a_mesh_of_a_body_is_served_from_the_dataset_that_carries_it(
    client: TestClient, remember: Remember, tmp_path: Path
) -> None:
    write_box(tmp_path / "crate.stl", (0, 0, 0), (0.1, 0.1, 0.1))
    (tmp_path / "a.yaml").write_text("trials: 1\nscene: {bodies: {crate: {shape: mesh, file: crate.stl}}}\n")
    directory = tmp_path / "datasets" / "a"
    directory.mkdir(parents=True)
    write_config(directory, load(tmp_path / "a.yaml"))
    remember("a", lives=False)
    look, _ = client.get(f"{URL}/a/scene").json()["bodies"]
    name = Path(look["mesh"]).name
    assert client.get(f"/api/v1/meshes/bodies/{name}").content == (directory / "bodies" / name).read_bytes()
