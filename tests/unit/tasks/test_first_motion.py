"""The first motion that `init` writes for a robot of another package keeps the limits of its joints."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from tests.e2e.collection import call_here
from tests.e2e.plugins import PLUGINS, process_with_plugins

from throwcollect.config.default_path import DEFAULT_CONFIG

LIMIT = 'lower="-2.5" upper="2.5" velocity="20"'


def limit_joints(directory: Path, *limits: str) -> Path:
    """Copy the package of the arm, with other limits for its shoulder and its elbow; returns its URDF."""
    for name in ("planar_arm", "planar_arm-1.0.dist-info", "reach", "reach-1.0.dist-info"):
        shutil.copytree(PLUGINS / name, directory / "plugins" / name)
    path = directory / "plugins" / "planar_arm" / "planar_arm.urdf"
    text = path.read_text()
    assert text.count(LIMIT) == len(limits)
    for limit in limits:
        text = text.replace(LIMIT, limit, 1)
    path.write_text(text)
    return path


def call_in(directory: Path, *commands: str) -> list[subprocess.CompletedProcess[str]]:
    """Run commands of throwcollect where that package is installed, in one process."""
    with process_with_plugins(directory / "plugins") as process:
        process.submit(os.chdir, directory).result()
        return [process.submit(call_here, *words.split()).result() for words in commands]


def test_no_trial_of_a_robot_with_narrow_limits_is_refused(tmp_path: Path) -> None:
    # The shoulder rests beyond its limit, and the elbow is slow.
    limit_joints(tmp_path, 'lower="-1.0" upper="-0.05" velocity="20"', 'lower="-2.5" upper="2.5" velocity="0.3"')
    written, planned = call_in(tmp_path, "init --robot planar_arm --task reach", "plan --trials 50")
    assert written.returncode == 0, written.stderr
    text = (tmp_path / DEFAULT_CONFIG).read_text()
    assert "50 trials; 0 refused" in planned.stderr, text + planned.stderr
    assert "  tolerance_rad: 0.01 # How far a joint may be from its end in the last sample\n" in text


def test_a_narrow_joint_of_a_throw_keeps_its_limits(tmp_path: Path) -> None:
    limit_joints(tmp_path, 'lower="-0.02" upper="0.02" velocity="20"', LIMIT)
    written, planned = call_in(tmp_path, "init --robot planar_arm", "plan --trials 20")
    assert written.returncode == 0, written.stderr
    assert "20 trials; 0 refused" in planned.stderr, planned.stderr
