"""Motions in docs/robots.md: the commands work, and the motion of another program's DMP becomes one of ours."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.e2e.collection import call_here
from tests.pages import find_blocks, read_section

from throwcollect.collect.coordinator.prepare import draw_plan
from throwcollect.config.loader import load
from throwcollect.robots.trajectory import sample_positions
from throwcollect.tasks.task import trajectory_of

ROOT = Path(__file__).parents[3]
PAGE = read_section("robots.md", "Motions from files")
CONFIG = ROOT / "configs" / "motions.yaml"


def test_the_example_has_each_motion_with_each_ball() -> None:
    plan = draw_plan(load(CONFIG), directory=CONFIG.parent)
    assert not plan.trials.refused
    assert [trial.values["task.trajectory.motion"] for trial in plan.trials] == [0, 0, 0, 1, 1, 1, 2, 2, 2]


def test_a_motion_becomes_a_dmp_that_follows_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (command,) = re.findall(r"^throwcollect (fit-dmp .*)$", PAGE, re.MULTILINE)
    monkeypatch.chdir(ROOT)
    done = call_here(*command.split())
    assert done.returncode == 0, done.stderr
    (tmp_path / "dmp.yaml").write_text(done.stdout)
    motion = trajectory_of(load(CONFIG, ["task.trajectory.motion=ahead"]))
    fitted = trajectory_of(load(tmp_path / "dmp.yaml"))
    miss = np.abs(sample_positions(fitted, motion.times) - motion.positions).max()
    said = re.search(r"within (\S+) rad", done.stderr)
    assert said
    assert float(said[1]) == pytest.approx(miss, rel=0.1)
    assert miss < 1e-3


class OtherDmp(SimpleNamespace):
    """A DMP by the equations of pydmps, with its constants."""

    def rollout(self, timesteps: int) -> tuple[np.ndarray, None, None]:
        count = self.w.shape[1]
        centres = np.exp(-np.linspace(0, 1, count))
        heights = count**1.5 / centres
        y, dy, x, path = self.y0.copy(), np.zeros(2), 1.0, []
        for _ in range(timesteps):
            x -= x * self.dt
            psi = np.exp(-heights * (x - centres) ** 2)
            force = x * (self.goal - self.y0) * (self.w @ psi) / psi.sum()
            dy = dy + (25 * (25 / 4 * (self.goal - y) - dy) + force) * self.dt
            y = y + dy * self.dt
            path.append(y)
        return np.array(path), None, None


def test_a_dmp_of_pydmps_becomes_one_of_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (code,) = find_blocks("python", PAGE)
    weights = np.random.default_rng(1).uniform(-30, 30, (2, 10))
    dmp = OtherDmp(y0=np.array([-1.9, -0.1]), goal=np.array([-1.2, 0.2]), w=weights, dt=0.002)
    monkeypatch.chdir(tmp_path)
    exec(code, {"dmp": dmp})  # noqa: S102
    (tmp_path / "other.yaml").write_text("task: {trajectory: {family: file, file: pydmps.npz}}\n")
    done = call_here("fit-dmp", "other.yaml")
    assert done.returncode == 0, done.stderr
    (tmp_path / "dmp.yaml").write_text(done.stdout)
    positions, _, _ = dmp.rollout(750)
    times = (1 + np.arange(750)) * dmp.dt
    assert sample_positions(trajectory_of(load(tmp_path / "dmp.yaml")), times) == pytest.approx(positions, abs=0.005)
