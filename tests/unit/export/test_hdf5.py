from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.export.conftest import HELD, MOVING, WITH_EPISODE, Export, table_of, throws_of

from throwcollect.config.schema import Config
from throwcollect.dataset.inspect import info
from throwcollect.dataset.reader import Dataset
from throwcollect.export import hdf5
from throwcollect.export.export import export

h5py = pytest.importorskip("h5py")
BESIDE = {"time_s", "command_velocity_radps", "command_acceleration_radps2"}


@pytest.mark.parametrize(("rate_hz", "step"), [(None, 1), (50, 5)])
def test_throws_are_arranged_as_robomimic_expects_them(
    rate_hz: int | None, step: int, exported: Export, source: Path
) -> None:
    with h5py.File(exported("hdf5", rate_hz) / "throws.hdf5") as file:
        data = file["data"]
        assert set(data) == {f"demo_{trial}" for trial in WITH_EPISODE}
        assert data.attrs["total"] == sum(group.attrs["num_samples"] for group in data.values())
        assert set(json.loads(data.attrs["env_args"])) == {"env_name", "type", "env_kwargs"}
        landed = [trial for trial in WITH_EPISODE if trial != HELD]
        assert file["mask/landed"][:].tolist() == [f"demo_{trial}".encode() for trial in landed]
        for trial, signals in throws_of(source, step):
            group = data[f"demo_{trial}"]
            count = group.attrs["num_samples"]
            for name, values in signals.items():
                place = name if name in BESIDE else "actions" if name == "command_position_rad" else f"obs/{name}"
                assert np.array_equal(group[place], values), name
            assert len(group["obs"]) == len(signals) - len(BESIDE) - 1
            last = np.arange(count) == count - 1
            assert np.array_equal(group["dones"], last)
            assert np.array_equal(group["rewards"], last * (trial != HELD))


def test_datasets_in_the_hdf5_file_state_their_units_and_components(exported: Export, source: Path) -> None:
    with h5py.File(exported("hdf5") / "throws.hdf5") as file:
        actions = file["data/demo_0/actions"].attrs
        assert (actions["unit"], list(actions["components"])) == (
            "rad",
            [f"{joint}_command_position_rad" for joint in MOVING],
        )
        assert file["throws/landing_x_m"].attrs["unit"] == "m"
        assert file.attrs["digest_of_dataset"] == info(source).digest
        assert Config.model_validate_json(file.attrs["config"]) == Dataset.open(source).config


def test_the_exported_table_has_all_trials(exported: Export, source: Path) -> None:
    with h5py.File(exported("hdf5") / "throws.hdf5") as file:
        for name, values in table_of(source).items():
            column = file["throws"][name]
            if h5py.check_string_dtype(column.dtype):
                assert column.asstr()[:].tolist() == [value or "" for value in values]
            else:
                missing = -1 if column.dtype.kind == "i" else np.nan
                assert np.array_equal(column, [missing if value is None else value for value in values], equal_nan=True)


def test_an_interruption_while_the_hdf5_file_is_written_to_ends_the_export(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, interrupted = hdf5._Output.write, False

    def be_interrupted(output: Any, data: Any) -> int:
        nonlocal interrupted
        # HDF5 writes compressed numbers, which begin so, when it closes their dataset.
        if not interrupted and bytes(data[:1]) == b"\x78":
            interrupted = True
            signal.raise_signal(signal.SIGINT)
        return write(output, data)

    monkeypatch.setattr(hdf5._Output, "write", be_interrupted)
    with pytest.raises(KeyboardInterrupt):
        export(source, tmp_path / "out", to="hdf5")
    assert interrupted
    assert list(tmp_path.iterdir()) == []
