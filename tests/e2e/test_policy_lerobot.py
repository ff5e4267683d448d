"""The example collects, exports, trains a policy of LeRobot and scores it: `make -f .ci/tests.mk lerobot`."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

for _needed in ("lerobot", "mujoco"):
    pytest.importorskip(_needed)

pytestmark = pytest.mark.e2e
ROOT = Path(__file__).parents[2]


def test_the_example_trains_a_policy_of_lerobot_and_scores_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    words = [ROOT / "examples" / "policy_lerobot.py", ROOT / "configs" / "quickstart.yaml", tmp_path / "out", "--quick"]
    # The other tests here forbid packages that no extra brings, but LeRobot brings its own.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, *words], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    for name in ("trained", "mean", "hold"):
        assert f"policy_lerobot:make_{name} throws at 2 targets" in done.stdout

    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    dataset = LeRobotDataset("me/throws", root=tmp_path / "out" / "export")
    names = dataset.meta.features["observation.environment_state"]["names"]
    for first in dataset.meta.episodes["dataset_from_index"]:
        swing, later = dataset[first + 15], dataset[first + 16]
        x, y = (float(swing["observation.environment_state"][names.index(f"target.{axis}")]) for axis in "xy")
        assert swing["task"] == f"Throw the ball to x {x:.2f} m, y {y:.2f} m."
        # In these simulations, joints follow what is commanded, so the action is the position of the next frame.
        now, then = (each["observation.state"][: len(swing["action"])] for each in (swing, later))
        assert (swing["action"] - then).abs().max() < 1e-4
        assert (swing["action"] - now).abs().max() > 1e-2
    longest = max(dataset.meta.episodes["length"])
    assert f"--policy.chunk_size={longest} " in (tmp_path / "out" / "export" / "README.md").read_text(encoding="utf-8")
