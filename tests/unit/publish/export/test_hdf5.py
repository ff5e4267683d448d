from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from tests.unit.publish.export.conftest import (
    HELD,
    MOVING,
    WITH_EPISODE,
    Export,
    actions_of,
    throws_of,
)

from throwcollect.config.schema import Config
from throwcollect.dataset.inspect import info
from throwcollect.dataset.reader import Dataset

h5py = pytest.importorskip("h5py")
BESIDE = {"time_s", "command_position_rad", "command_velocity_radps", "command_acceleration_radps2"}


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
        for (trial, signals), actions in zip(throws_of(source, step), actions_of(source, step), strict=True):
            group = data[f"demo_{trial}"]
            count = group.attrs["num_samples"]
            assert np.array_equal(group["actions"], actions)
            for name, values in signals.items():
                assert np.array_equal(group[name if name in BESIDE else f"obs/{name}"], values), name
                if name not in BESIDE:
                    assert np.array_equal(group[f"next_obs/{name}"], [*values[1:], values[-1]]), name
            assert len(group["obs"]) == len(group["next_obs"]) == len(signals) - len(BESIDE)
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
        assert actions["description"].endswith("One sample later.")
        assert file["throws/landing_x_m"].attrs["unit"] == "m"
        assert file["data/demo_0/command_acceleration_radps2"].attrs["unit"] == "rad/s^2"
        assert file.attrs["digest_of_dataset"] == info(source).digest
        assert Config.model_validate_json(file.attrs["config"]) == Dataset.open(source).config
