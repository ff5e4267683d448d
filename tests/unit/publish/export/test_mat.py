from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.io import loadmat
from tests.unit.publish.export.conftest import HELD, MOVING, Export, moving_columns, table_of, throws_of

from throwcollect.dataset.inspect import info
from throwcollect.dataset.reader import Dataset
from throwcollect.publish.export.export import export

FIELDS = ["N", "dt", "a_z", "a_x", "c", "sigma_2", "w", "tau", "goal", "y0", "fitted", "error"]
WEIGHTS = [-758.2, -994.1, -1122.1, -1231.2, -1231.1, -1114.2, -858.3, -508.7, -155.7, 74.0, 57.6, -56.9]
OF_A_DMP: dict[str, Any] = {
    "trials": 2,
    "task": {
        "trajectory": {"family": "dmp", "basis_functions": 12, "weights": {"arm_right_4_joint": WEIGHTS}},
        "end": {"torso_1_joint": 0.1, "arm_right_4_joint": -0.5},
    },
    "sweep": {
        "sampler": "uniform",
        "parameters": {"task.trajectory.weights.arm_right_4_joint.5": {"min": -1170.0, "max": -1060.0}},
    },
}


def open_recordings(directory: Path, source: Path) -> dict[int, Any]:
    """`robot_throws` of each recording and the number of the throw in it, by trial: all that have an episode."""
    found = {}
    for path in sorted((directory / "trajectories").iterdir()):
        throws = loadmat(path)["robot_throws"][0, 0]
        for number, trial in enumerate(throws["trial"][:, 0]):
            found[int(trial)] = (throws, number)
    assert list(found) == Dataset.open(source).recorded["trial"].tolist()
    return found


def motion(dmp: Any, times: np.ndarray) -> np.ndarray:
    """The motion of a DMP by its equations, integrated independently of the exporter."""
    a_z, a_x, tau = (float(dmp[name][0, 0]) for name in ("a_z", "a_x", "tau"))
    count = dmp["w"].shape[1]

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        y, z = state[:count], state[count:]
        x = np.exp(-a_x * t / tau)
        psi = np.exp(-((x - dmp["c"][0]) ** 2) / (2 * dmp["sigma_2"][0]))
        force = psi @ dmp["w"] / psi.sum() * x
        return np.concatenate([z, a_z * (a_z / 4 * (dmp["goal"][0] - y) - z) + force]) / tau

    start = np.concatenate([dmp["y0"][0], np.zeros(count)])
    solved = solve_ivp(slope, (0, times[-1]), start, t_eval=times, rtol=1e-9, atol=1e-9, method="LSODA")
    return solved.y[:count].T


@pytest.mark.parametrize(("rate_hz", "step"), [(None, 1), (50, 5)])
def test_measured_series_equal_the_samples_of_the_dataset(
    rate_hz: int | None, step: int, exported: Export, source: Path
) -> None:
    found = open_recordings(exported("mat", rate_hz), source)
    moving = moving_columns()
    for trial, signals in throws_of(source, step):
        throws, number = found.pop(trial)
        measured = [signals[f"joint_{name}"][:, moving] for name in ("position_rad", "velocity_radps", "effort_nm")]
        ball = [signals["ball_position_m"], signals["ball_velocity_mps"]]
        assert np.array_equal(throws["measured"][0, number], np.column_stack([signals["time_s"], *measured]))
        assert np.array_equal(throws["ball"][0, number], np.column_stack([signals["time_s"], *ball]))
    assert not found


def test_the_exported_path_is_the_commanded_motion_up_to_rest(exported: Export, source: Path) -> None:
    found = open_recordings(exported("mat"), source)
    for trial, signals in throws_of(source):
        throws, number = found[trial]
        path = throws["qPath"][0, number]
        names = ("command_position_rad", "command_velocity_radps", "command_acceleration_radps2")
        command = np.column_stack([signals["time_s"], *(signals[name] for name in names)])
        both = min(len(path), len(command))
        np.testing.assert_allclose(path[:both], command[:both], rtol=0, atol=1e-12)
        assert path.shape[1] == 1 + 3 * len(MOVING)
        np.testing.assert_allclose(path[-1, 1:6], throws["DMP"][0, number]["goal"][0, 0][0], rtol=0, atol=1e-12)
        np.testing.assert_allclose(path[-1, 6:], 0, atol=1e-7)
        assert [name[0] for name in throws["robot_data"][0, 0]["joints"][0]] == MOVING
        assert throws["robot_data"][0, 0]["dt"][0, 0] == 1 / 250


def test_the_exported_targets_are_where_the_throws_landed(exported: Export, source: Path) -> None:
    found, table = open_recordings(exported("mat"), source), table_of(source)
    for trial, (throws, number) in found.items():
        distance, height, angle = throws["targets"][number]
        assert height == 0.0
        if trial == HELD:
            assert np.isnan([distance, angle]).all()
        else:
            assert distance == pytest.approx(np.hypot(table["landing_x_m"][trial], table["landing_y_m"][trial]))
            assert angle == table["hit_angle_rad"][trial]


def test_a_fitted_dmp_moves_as_commanded_up_to_its_error(exported: Export, source: Path) -> None:
    for throws, number in open_recordings(exported("mat"), source).values():
        dmp, path = throws["DMP"][0, number][0, 0], throws["qPath"][0, number]
        assert list(dmp.dtype.names) == FIELDS
        assert (dmp["N"][0, 0], dmp["fitted"][0, 0]) == (25, 1)
        assert [dmp[name].shape for name in ("c", "sigma_2", "w", "goal", "y0")] == [
            (1, 25),
            (1, 25),
            (25, 5),
            (1, 5),
            (1, 5),
        ]
        distance = np.abs(motion(dmp, path[:, 0]) - path[:, 1:6]).max(axis=0)
        np.testing.assert_allclose(distance, dmp["error"][0], rtol=0, atol=2e-6)
        assert dmp["error"].max() < 3e-4


def test_a_dmp_of_the_configuration_is_exported_with_its_own_weights(make_collection: Any, tmp_path: Path) -> None:
    dataset = make_collection(OF_A_DMP).collect(tmp_path / "dataset")
    export(dataset, tmp_path / "out", to="mat")
    swept = table_of(dataset)["task_trajectory_weights_arm_right_4_joint_5"]
    assert Dataset.open(dataset).config.task.trajectory.family == "dmp"
    for trial, (throws, number) in open_recordings(tmp_path / "out", dataset).items():
        dmp, path = throws["DMP"][0, number][0, 0], throws["qPath"][0, number]
        expected = np.array([*WEIGHTS[:5], swept[trial], *WEIGHTS[6:]])
        assert dmp["fitted"][0, 0] == 0
        assert np.array_equal(dmp["w"], np.column_stack([expected, np.zeros(12)]))
        distance = np.abs(motion(dmp, path[:, 0]) - path[:, 1:3]).max(axis=0)
        np.testing.assert_allclose(distance, dmp["error"][0], rtol=0, atol=1e-5)
        assert dmp["error"].max() < 2e-3


def test_the_exported_table_has_all_trials_with_units(exported: Export, source: Path) -> None:
    contents = loadmat(exported("mat") / "throws.mat")
    throws, units = contents["throws"][0, 0], contents["units"][0, 0]
    assert contents["digest_of_dataset"][0] == info(source).digest
    for name, values in table_of(source).items():
        column = throws[name][:, 0]
        if column.dtype == object:
            assert [str(cell[0]) if cell.size else "" for cell in column] == [value or "" for value in values]
        else:
            missing = -1 if column.dtype.kind == "i" else np.nan
            assert np.array_equal(column, [missing if value is None else value for value in values], equal_nan=True), (
                name
            )
    assert units["landing_vx_mps"][0] == "m/s"
    assert units["task_end_arm_right_4_joint"][0] == "rad"
