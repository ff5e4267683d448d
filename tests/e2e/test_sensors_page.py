"""The section on sensors, block by block and command by command."""

import re
import shlex
import struct
from pathlib import Path

import numpy as np
import pytest

import throwcollect
from tests.e2e.collection import INPROCESS, call_here
from tests.pages import find_blocks, read_section

images = pytest.importorskip("PIL.Image")

pytestmark = pytest.mark.e2e
PAGE = read_section("robots.md", "Cameras and lidars")


def test_the_page_is_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in zip(("seen.yaml", "other.yaml", "random.yaml"), find_blocks("yaml", PAGE), strict=True):
        (tmp_path / name).write_text(text, encoding="utf-8")
    printed = {}
    for line in "".join(find_blocks("sh", PAGE)).replace("up -n 2 ", "up ").splitlines():
        words = shlex.split(line)[1:]
        # Sensors see what was recorded, whatever has simulated it.
        few = {"up": (*INPROCESS, "--set", "run.replay=0"), "plan": ()}.get(words[0])
        done = call_here(*words, *(() if few is None else (*few, "--set", "sim.engine=ballistic")))
        assert done.returncode == 0, (line, done.stderr)
        assert "Traceback" not in done.stderr
        printed[" ".join(words[:2])] = done.stdout + done.stderr
    cost = (
        r"sensors: \d+ frames a throw, about \+\d+ ms \([\d.]+ throws\) and \+\d+ kB; all 8 trials: \+\d+ s of one core"
    )
    assert re.search(cost, printed["plan seen.yaml"])
    assert re.search(cost, printed["up seen.yaml"])
    names = ["cloud_points", "scan_scan", "side_color", "side_depth", "side_segmentation", "wrist_depth"]
    assert sorted(path.stem for path in (tmp_path / "first").iterdir()) == names
    dataset = throwcollect.load(tmp_path / "data" / "seen")
    side = dataset[0].sensors["side"]
    # The pictures have what is recorded first, with all of its bits.
    stem = tmp_path / "first" / "side_"
    for stream, frames in (("color", side.images), ("segmentation", side.labels), ("depth", side.depth_m[:] * 1000)):
        picture = np.asarray(images.open(f"{stem}{stream}.png"))
        assert np.array_equal(picture, np.where(np.isinf(frames[0]), 0, np.rint(frames[0])))
    assert struct.unpack(">B", Path(f"{stem}depth.png").read_bytes()[24:25]) == (16,)
    front = throwcollect.load(tmp_path / "data" / "front")
    assert [throw["digest"] for throw in front] == [throw["digest"] for throw in dataset]
    assert list(front[0].sensors) == ["front"]
    eyes = throwcollect.load(tmp_path / "data" / "random")
    assert len({throw.sensors["eye"].intrinsics[0, 0] for throw in eyes}) == 4
    exec("\n".join(find_blocks("python", PAGE)), {})  # noqa: S102
    said = capsys.readouterr().out
    assert "SensorFrames(side: 1" in said
    assert "(96, 96, 3) uint8" in said
    assert "(360,) (16, 180)" in said
    assert "'side_depth': ((96, 96, 1), 'float32')" in said
    assert "'action': ((8, 5), 'float32')" in said
