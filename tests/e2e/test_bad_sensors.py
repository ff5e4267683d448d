"""Mistakes in sections of sensors, and damaged frames: one message with file, line, key or place, and no files."""

import shutil
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zstandard

import throwcollect
from tests.e2e.collection import call_here, collect_here
from throwcollect.episode.chunk import Chunk

pytestmark = pytest.mark.e2e
CONFIG = """\
trials: 2
sim: {{engine: ballistic}}
sweep: {{parameters: {{task.duration_s: {{min: 1.0, max: 1.2}}{swept}}}}}
sensors:
{sensors}
"""
SENSOR, LINE = "  eye: {{kind: camera, {}}}", "bad.yaml:5: sensors.eye."


@pytest.mark.parametrize(
    ("sensors", "swept", "message"),
    [
        (
            SENSOR.format("link: hed_2_link"),
            "",
            f"{LINE}link: there is no link 'hed_2_link'; did you mean 'head_2_link'",
        ),
        (SENSOR.format("rate_hz: 30"), "", f"{LINE}rate_hz: should divide record.rate_hz, 250, got 30"),
        ("  eye: {kind: lidar}", "", f"{LINE}kind: should be 'camera', 'depth', 'lidar_2d' or 'lidar_3d', got 'lidar'"),
        ("  ball: {kind: camera}", "", "bad.yaml:5: sensors.ball: should have another name, as ball is a frame or a"),
        (
            SENSOR.format("rate_hz: 5"),
            ", sensors.eys.vertical_fov_rad: {min: 0.9, max: 1.1}",
            "bad.yaml:3: sweep.parameters.sensors.eys.vertical_fov_rad: unknown key; did you mean 'sensors.eye.",
        ),
    ],
)
def test_a_wrong_sensor_is_refused_with_file_line_and_key(
    sensors: str, swept: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.yaml").write_text(CONFIG.format(sensors=sensors, swept=swept))
    for command in (("plan",), ("up", "--runtime", "inprocess", "-o", "data")):
        done = call_here(*command, "bad.yaml")
        assert done.returncode == 2, done.stderr
        assert done.stderr.splitlines()[-1].removeprefix("throwcollect: ").startswith(message)
        assert [path.name for path in tmp_path.iterdir()] == ["bad.yaml"]


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("seen")
    swept = ", sensors.eye.vertical_fov_rad: {min: 0.9, max: 1.1}"
    (directory / "seen.yaml").write_text(CONFIG.format(sensors=SENSOR.format("rate_hz: 5"), swept=swept))
    collect_here(directory / "seen.yaml", directory / "data", "--set", "name=seen")
    return directory / "data"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sensors:\n  eye: {kind: camera, rate_hz: 30}", "s.yaml:2: sensors.eye.rate_hz: should divide record.rate"),
        (
            "sensors: {}",
            "s.yaml:1: sensors.eye.vertical_fov_rad: the dataset sweeps it, so the sensors should have it: unknown key",
        ),
    ],
)
def test_a_wrong_file_of_sensors_is_refused(
    text: str, message: str, seen: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(text)
    done = call_here("dataset", "render-sensors", seen, "new", "--sensors", "s.yaml")
    assert done.returncode == 2
    assert done.stderr.startswith(f"throwcollect: {message}")
    assert [path.name for path in tmp_path.iterdir()] == ["s.yaml"]


def test_a_camera_inside_of_the_robot_is_found(tmp_path: Path) -> None:
    (tmp_path / "inside.yaml").write_text(
        CONFIG.format(sensors=SENSOR.format("link: torso_2_link, near_m: 0.001") + "\n  far: {kind: camera}", swept="")
    )
    done = call_here("plan", tmp_path / "inside.yaml")
    assert done.returncode == 0
    warnings = [line for line in done.stderr.splitlines() if line.startswith("warning: sensors")]
    assert warnings == ["warning: sensors.eye: torso_1_link fills the first picture; the camera may be inside of it"]


def join(*indexes: bytes | bytearray) -> bytes:
    return b"".join(indexes)


def announce_much(chunk: Chunk) -> bytes:
    # It is compressed by less than what any chunk may be.
    contents = bytes(2**28) + np.random.default_rng(0).bytes(80_000)
    record = Chunk.of(contents, zstandard.compress(contents), start_ns=chunk.start_ns, end_ns=chunk.end_ns).record()
    return record + join(*chunk.indexes.values())


def cut_off(chunk: Chunk) -> bytes:
    return replace(chunk, data=chunk.data[: len(chunk.data) // 2]).record() + join(*chunk.indexes.values())


def cut_index(chunk: Chunk) -> bytes:
    return chunk.record() + next(iter(chunk.indexes.values()))[:20]


def of_other_channels(chunk: Chunk) -> bytes:
    indexes = {number: bytearray(index) for number, index in chunk.indexes.items()}
    for number, index in indexes.items():
        struct.pack_into("<H", index, 9, number + 500)
    return chunk.record() + join(*indexes.values())


@pytest.mark.parametrize(
    ("forge", "problem"),
    [
        (announce_much, "announces 268515456 bytes of frames"),
        (cut_off, "cannot be decompressed"),
        (cut_index, "goes beyond the end of the file"),
        (of_other_channels, "0 frames of eye"),
    ],
)
def test_damaged_frames_are_refused_with_their_place(
    forge: Callable[[Chunk], bytes], problem: str, seen: Path, tmp_path: Path
) -> None:
    directory = tmp_path / "data"
    shutil.copytree(seen, directory)
    throw = throwcollect.load(directory)[0]
    [chunk] = throw.read_episode(sensors=True).sensors
    path = directory / "seen_00000.mcap"
    whole = chunk.record() + join(*chunk.indexes.values())
    path.write_bytes(path.read_bytes().replace(whole, forge(chunk), 1))
    done = call_here("dataset", "export", directory, tmp_path / "new", "--to", "npz", "--images", "arrays")
    assert done.returncode == 4
    assert done.stderr.startswith(f"throwcollect: {directory}") or "trial 0, eye: chunk" in done.stderr
    assert problem in done.stderr
    assert not (tmp_path / "new").exists()
    found = call_here("dataset", "verify", directory)
    assert (found.returncode, "seen_00000.mcap" in found.stdout, "Traceback" in found.stderr) == (4, True, False)
