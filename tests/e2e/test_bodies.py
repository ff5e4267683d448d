"""Bodies that the ball pushes, from the YAML file to Python, exports, viewers and pictures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import throwcollect
from tests.e2e.collection import collect_here
from throwcollect.config.loader import load
from throwcollect.dataset.verify import verify
from throwcollect.publish.export.export import export

pytestmark = pytest.mark.e2e

CONFIG = """\
name: cans
trials: 3
seed: 7
sim: {engine: mujoco}
record: {topics: [joint_states, ball/odometry, tf]}
run: {replay: 0}
scene:
  bodies:
    table: {shape: box, size_m: [0.8, 1.2, 0.04], position_m: [1.6, -0.3, 0.5]}
    can:
      {shape: cylinder, radius_m: 0.05, length_m: 0.2, mass_kg: 0.1, position_m: [1.5, -0.23, 0.62], color: "#c02b2b"}
    brick: {shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 0.1, position_m: [1.65, -0.5, 0.57]}
sweep:
  parameters:
    task.end.arm_right_4_joint: {min: -0.62, max: -0.6}
"""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("bodies")
    (directory / "cans.yaml").write_text(CONFIG, encoding="utf-8")
    collect_here(directory / "cans.yaml", directory / "data")
    return directory / "data"


@pytest.fixture(scope="module")
def pushed(dataset: Path) -> int:
    """Number of a trial whose ball hit the can."""
    return next(throw.trial for throw in throwcollect.load(dataset) if throw.outcome == "body_hit")


def test_python_has_the_motion_of_each_body(dataset: Path, pushed: int) -> None:
    throw = throwcollect.load(dataset)[pushed]
    can, brick = throw.bodies["can"], throw.bodies["brick"]
    assert np.linalg.norm(can.position[-1] - can.position[0]) > 0.02
    assert np.abs(brick.position - brick.position[0]).max() < 1e-3
    speeds = np.diff(can.position, axis=0) * load(dataset / "config.yaml").record.rate_hz
    middle = (can.velocity[1:] + can.velocity[:-1]) / 2
    # Impacts apart, velocities are those of the positions, in world.
    assert np.median(np.abs(speeds - middle)) < 1e-3
    assert verify(dataset, processes=2) == []


def test_trajectories_have_columns_for_bodies(dataset: Path) -> None:
    loaded = throwcollect.load(dataset)
    found = loaded.trajectories(["can_velocity", "brick_position", "ball_velocity"])
    for throw, arrays in zip(loaded, found, strict=True):
        np.testing.assert_allclose(arrays["can_velocity"], throw.bodies["can"].velocity, rtol=0, atol=1e-14)
        np.testing.assert_array_equal(arrays["brick_position"], throw.bodies["brick"].position)
        np.testing.assert_allclose(arrays["ball_velocity"], throw.object.velocity, rtol=0, atol=1e-14)
    assert {"can_angular_velocity", "brick_orientation_xyzw"} <= loaded.trajectories().columns.keys()


@pytest.mark.parametrize("rate_hz", [250, 50])
def test_exports_have_columns_for_bodies(dataset: Path, pushed: int, rate_hz: int, tmp_path: Path) -> None:
    export(dataset, tmp_path / "out", to="parquet", rate_hz=rate_hz)
    table = pq.read_table(tmp_path / "out" / "trajectories", filters=[("trial", "==", pushed)])
    can = throwcollect.load(dataset)[pushed].bodies["can"]
    assert table["can_z_m"].to_pylist()[0] == can.position[0, 2]
    assert table["can_x_m"].to_numpy().max() == pytest.approx(can.position[:, 0].max(), abs=2e-3)
    turns = np.column_stack([table[f"can_q{axis}"].to_numpy() for axis in "xyzw"])
    assert np.linalg.norm(turns, axis=1) == pytest.approx(1.0)


def test_policies_get_the_bodies_as_state_of_the_environment(dataset: Path, pushed: int, tmp_path: Path) -> None:
    export(dataset, tmp_path / "out", to="lerobot")
    names = json.loads((tmp_path / "out" / "meta" / "info.json").read_text())["features"]
    state = names["observation.environment_state"]["names"]
    assert [name for name in state if name.endswith(".x")] == ["ball.x", "can.x", "brick.x"]
    (file,) = (tmp_path / "out" / "data").rglob("*.parquet")
    rows = pq.read_table(file)["observation.environment_state"].to_pylist()
    seen = {round(row[state.index("can.x")], 4) for row in rows}
    can = throwcollect.load(dataset)[pushed].bodies["can"]
    assert {round(float(x), 4) for x in can.position[:, 0].astype(np.float32)} <= seen
