"""Files of motions: every kind gives the same motions, and each way to be wrong has one message."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.writer import Writer

from rclzenoh.interfaces import get_message, serialize
from throwcollect import Simulator
from throwcollect.collect.coordinator.prepare import draw_plan
from throwcollect.config.loader import load
from throwcollect.errors import ConfigError
from throwcollect.robots.description import robot_of
from throwcollect.tasks.motions import Motions, motions_of
from throwcollect.tasks.task import trajectory_of

ELBOW, WRIST = JOINTS = ("arm_right_4_joint", "arm_right_7_joint")
STARTS = {ELBOW: -1.85, WRIST: -0.1}
"""The elbow starts elsewhere than by default."""
TIMES = np.arange(26) / 25
SHARE = 10 * TIMES**3 - 15 * TIMES**4 + 6 * TIMES**5
ENDS = np.array([[-0.5, 0.5], [-0.6, 0.4], [-0.7, 0.3]])
PATHS = np.array(list(STARTS.values())) + (ENDS - list(STARTS.values()))[:, np.newaxis] * SHARE[:, np.newaxis]
ENDS = PATHS[:, -1]


def write_long(directory: Path, suffix: str = "csv", **columns: Any) -> str:
    """Three motions in one long file; `columns` replace or, with None, remove columns."""
    rows: dict[str, Any] = {
        "motion": np.repeat(["a", "b", "c"], len(TIMES)),
        "time_s": np.tile(TIMES, 3),
        **{f"{joint}_rad": PATHS[..., column].ravel() for column, joint in enumerate(JOINTS)},
    } | columns
    rows = {name: values for name, values in rows.items() if values is not None}
    if suffix == "parquet":
        pq.write_table(pa.table(rows), directory / "motions.parquet")
    else:
        lines = [",".join(rows), *(",".join(map(str, row)) for row in zip(*rows.values(), strict=True))]
        (directory / f"motions.{suffix}").write_text("\n".join(lines))
    return f"file: motions.{suffix}"


def write_directory(directory: Path) -> str:
    (directory / "motions").mkdir()
    for number, path in enumerate(PATHS):
        lines = [f"time_s,{ELBOW}_rad,{WRIST}_rad"]
        lines += [f"{time},{row[0]},{row[1]}" for time, row in zip(TIMES.tolist(), path.tolist(), strict=True)]
        # The names are in another order than the numbers in them.
        (directory / "motions" / f"m{8 + number}.csv").write_text("\n".join(lines))
    return "file: motions"


def write_npz(directory: Path, **arrays: Any) -> str:
    np.savez(directory / "m.npz", **{"time_s": TIMES, "position_rad": PATHS, "joints": np.array(JOINTS)} | arrays)
    return "file: m.npz"


def write_robomimic(directory: Path) -> str:
    h5py = pytest.importorskip("h5py")
    gripper = np.zeros((len(TIMES), 1))
    with h5py.File(directory / "m.hdf5", "w") as file:
        for number, path in enumerate(PATHS):
            file[f"data/demo_{number + 9}/actions"] = np.hstack([path, gripper])
    return f"file: m.hdf5, rate_hz: 25, joints: [{ELBOW}, {WRIST}, null]"


def write_aloha(directory: Path) -> str:
    h5py = pytest.importorskip("h5py")
    (directory / "aloha").mkdir()
    for number, path in enumerate(PATHS):
        with h5py.File(directory / "aloha" / f"episode_{number}.hdf5", "w") as file:
            file["action"] = path
    return f"file: aloha, rate_hz: 25, joints: [{ELBOW}, {WRIST}]"


def write_lerobot(directory: Path, names: Any = tuple(f"{joint}.pos" for joint in JOINTS)) -> str:
    (directory / "set" / "meta").mkdir(parents=True)
    info = {"fps": 25, "features": {"action": {"names": names}}}
    (directory / "set" / "meta" / "info.json").write_text(json.dumps(info))
    (directory / "set" / "data" / "chunk-000").mkdir(parents=True)
    table = pa.table(
        {
            "action": pa.FixedSizeListArray.from_arrays(pa.array(PATHS.ravel()), 2),
            "episode_index": np.repeat(np.arange(3), len(TIMES)),
        }
    )
    pq.write_table(table, directory / "set" / "data" / "chunk-000" / "file-000.parquet")
    return "file: set"


def write_lerobot_with_motors(directory: Path) -> str:
    return write_lerobot(directory, {"motors": list(JOINTS)})


def write_mcap(directory: Path) -> str:
    kind, point, duration = (
        get_message(name)
        for name in (
            "trajectory_msgs/msg/JointTrajectory",
            "trajectory_msgs/msg/JointTrajectoryPoint",
            "builtin_interfaces/msg/Duration",
        )
    )
    with (directory / "m.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("trajectory_msgs/msg/JointTrajectory", "ros2msg", b"")
        channel = writer.register_channel("/arm/joint_trajectory", "cdr", schema)
        for number, path in enumerate(PATHS):
            points = [
                point(
                    positions=row[::-1],
                    time_from_start=duration(sec=int(time), nanosec=round(time % 1 * 1e9)),
                )
                for time, row in zip(TIMES, path.tolist(), strict=True)
            ]
            message = kind(joint_names=list(JOINTS[::-1]), points=points)
            writer.add_message(channel, log_time=number, data=serialize(message), publish_time=number)
        writer.finish()
    return "file: m.mcap"


KINDS: dict[str, Callable[[Path], str]] = {
    "csv": write_long,
    "parquet": lambda directory: write_long(directory, "parquet"),
    "directory": write_directory,
    "npz": write_npz,
    "robomimic": write_robomimic,
    "aloha": write_aloha,
    "lerobot": write_lerobot,
    "lerobot v2": write_lerobot_with_motors,
    "mcap": write_mcap,
}


def write_config(directory: Path, trajectory: str, rest: str = "") -> Path:
    path = directory / "config.yaml"
    path.write_text(f"task:\n  trajectory: {{family: file, {trajectory}}}\n{rest}")
    return path


def read(directory: Path, trajectory: str) -> Motions:
    config = load(write_config(directory, trajectory))
    return motions_of(config.task.trajectory, robot_of(config))


def plan(directory: Path, trajectory: str, rest: str = "") -> Any:
    return draw_plan(load(write_config(directory, trajectory, rest)), directory=directory)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_file_gives_the_same_motions(kind: str, tmp_path: Path) -> None:
    motions = read(tmp_path, KINDS[kind](tmp_path))
    assert motions.joints == JOINTS
    for number, path in enumerate(PATHS):
        trajectory = motions.trajectory(number)
        assert trajectory.times == pytest.approx(TIMES, abs=1e-12)
        assert np.array_equal(trajectory.positions, path)
        assert np.array_equal(trajectory.velocities[[0, -1]], np.zeros((2, 2)))
        speed = 30 * (TIMES**2 - 2 * TIMES**3 + TIMES**4)[:, np.newaxis] * (path[-1] - path[0])
        assert trajectory.velocities == pytest.approx(speed, abs=0.05)


def test_each_trial_has_the_next_motion_with_its_start_and_its_end(tmp_path: Path) -> None:
    paths = PATHS.copy()
    paths[2] += 0.01
    found = plan(tmp_path, write_npz(tmp_path, position_rad=paths))
    assert not found.trials.refused
    assert [trial.values["task.trajectory.motion"] for trial in found.trials] == [0, 1, 2]
    for trial, path in zip(found.trials, paths, strict=True):
        config = found.config_of(trial)
        assert [config.task.start[joint] for joint in JOINTS] == path[0].tolist()
        assert [config.task.end[joint] for joint in JOINTS] == path[-1].tolist()
        assert np.array_equal(trajectory_of(config).positions, path)
    # The joints that do not move start where they always do.
    assert found.config.task.start["arm_right_2_joint"] == -2.6


SWEPT = "trials: 5\nsweep: {sampler: uniform, parameters: {ball.mass_kg: {min: 0.03, max: 0.06}}}"


@pytest.mark.parametrize(
    ("keys", "rest", "chosen"),
    [
        ("", "", [0, 1, 2]),
        ("", "trials: 2", [0, 1]),
        ("motion: 1", "", [1]),
        ("motion: c", "", [2]),
        ("", SWEPT, [0, 1, 2, 0, 1]),
        ("motion: b", SWEPT, [1, 1, 1, 1, 1]),
        ("", "sweep: {sampler: grid, parameters: {task.trajectory.motion: {values: [2, 0]}}}", [2, 0]),
    ],
)
def test_a_motion_is_chosen_by_number_name_or_sweep(keys: str, rest: str, chosen: list[int], tmp_path: Path) -> None:
    found = plan(tmp_path, f"{write_long(tmp_path)}, {keys}".rstrip(", "), rest)
    assert [trial.values["task.trajectory.motion"] for trial in found.trials] == chosen
    assert [found.config_of(trial).task.end[ELBOW] for trial in found.trials] == ENDS[chosen, 0].tolist()


def test_a_list_of_trials_may_choose_the_motions(tmp_path: Path) -> None:
    (tmp_path / "list.csv").write_text("task.trajectory.motion,ball.mass_kg\n2,0.04\n0,0.05\n")
    found = plan(tmp_path, write_long(tmp_path), "sweep: {sampler: list, file: list.csv}")
    assert [found.config_of(trial).task.end[WRIST] for trial in found.trials] == ENDS[[2, 0], 1].tolist()


def test_equal_motions_have_one_digest_whatever_file_they_are_in(tmp_path: Path) -> None:
    assert read(tmp_path, write_long(tmp_path)).digest == read(tmp_path, write_long(tmp_path, "parquet")).digest
    moved = write_long(tmp_path, **{f"{ELBOW}_rad": PATHS[..., 0].ravel() + 1e-9})
    assert read(tmp_path, moved).digest != read(tmp_path, write_long(tmp_path, "parquet")).digest


def test_motions_of_an_npz_may_have_different_lengths(tmp_path: Path) -> None:
    motions = read(tmp_path, write_npz(tmp_path, length=np.array([26, 10, 26])))
    assert [len(motions.trajectory(number).times) for number in range(3)] == [26, 10, 26]


def test_a_simulator_throws_a_motion_by_its_number(tmp_path: Path) -> None:
    path = write_config(tmp_path, write_long(tmp_path), "sim: {engine: ballistic}")
    with Simulator(path) as simulator:
        throw = simulator.throw({"task.trajectory.motion": 1})
    assert throw["task_end_arm_right_4_joint"] == ENDS[1, 0]


def replaced(column: np.ndarray, row: int, value: float) -> np.ndarray:
    changed = column.copy().ravel()
    changed[row] = value
    return changed


TILED, BENT = np.tile(TIMES, 3), PATHS[..., 0].ravel()


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"arm_rihgt_2_joint_rad": BENT}, "arm_rihgt_2_joint_rad: Talos has no joint 'arm_rihgt_2_joint'; did you"),
        ({f"{ELBOW}_radps": BENT * 0}, f"{WRIST}_radps: the column is missing"),
        ({"time_s": TILED + 1}, "motion 'a', point 1: time_s should begin at 0, got 1"),
        ({"time_s": replaced(TILED, 30, 0.1)}, "motion 'b', point 5: time_s should rise, got 0.1"),
        ({f"{joint}_radps": BENT * 0 + 0.5 for joint in JOINTS}, f"motion 'a', point 1: {ELBOW}_radps should be 0, as"),
        ({"motion": np.arange(78)}, "motion '0', point 1: time_s should be that of 2 points or more, got 0"),
    ],
)
def test_numbers_that_are_no_motions_are_refused(columns: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as refused:
        plan(tmp_path, write_long(tmp_path, **columns))
    (problem,) = refused.value.problems
    assert f"{tmp_path}/motions.csv: {message}" in str(problem)


@pytest.mark.parametrize(
    ("keys", "rest", "message"),
    [
        ("file: motion.csv", "", ":2: task.trajectory.file: there is no file .*; did you mean"),
        ("file: motions.csv", "  duration_s: 2", "task.duration_s: should be left out, as the file of motions has t"),
        ("file: motions.csv", "trials: 4", "trials: should be at most 3"),
    ],
)
def test_keys_that_do_not_fit_the_file_are_refused(keys: str, rest: str, message: str, tmp_path: Path) -> None:
    write_long(tmp_path)
    with pytest.raises(ConfigError, match=message):
        plan(tmp_path, keys, rest)


def test_a_motion_that_the_robot_cannot_do_is_refused_as_every_other(tmp_path: Path) -> None:
    fast = plan(tmp_path, write_long(tmp_path, time_s=replaced(TILED, slice(26, 52), TIMES / 10)))
    assert fast.trials.refused.keys() == {1}
    assert "moves at" in fast.trials.refused[1]
