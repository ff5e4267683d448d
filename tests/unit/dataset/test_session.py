"""Datasets that grow by what clients of a session do."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import throwcollect
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.dataset.derive.derivation import merge
from throwcollect.dataset.session import SessionDataset
from throwcollect.dataset.shard import OpenShard
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.robots.description import robot_of
from throwcollect.simulator import Simulator

CONFIG = Config()
CONFIGS = Path(__file__).parents[3] / "configs"


@pytest.fixture(scope="module")
def recorded() -> tuple[EpisodeHeader, Samples]:
    return record(CONFIG)


def record(config: Config) -> tuple[EpisodeHeader, Samples]:
    """Simulate a throw, as a session hands it over."""
    with Simulator(config) as simulator:
        episode = simulator.throw({}).read_episode()
    joints = robot_of(config).joints
    samples = episode.samples(joints)
    moved = samples.position[:, [joints.index(joint) for joint in config.moving_joints]]
    command = np.stack([np.vstack([moved[1:], moved[-1:]])] * 2, axis=1)
    return episode.header, replace(samples, command=command)


@pytest.fixture
def session(tmp_path: Path) -> Iterator[SessionDataset]:
    dataset = SessionDataset(tmp_path / "recorded", CONFIG, name="sim_0")
    yield dataset
    dataset.close()


def test_sessions_append_to_a_dataset_that_is_finished_after_each_episode(
    session: SessionDataset, recorded: tuple[EpisodeHeader, Samples]
) -> None:
    number, result = session.append(*recorded)
    assert (number, result.outcome.value, verify(session.directory)) == (0, "landed", [])
    with pytest.raises(DatasetError, match="another process collects into it"):
        SessionDataset(session.directory, CONFIG, name="sim_1")
    session.close()
    later = SessionDataset(session.directory, CONFIG, name="sim_1")
    assert later.append(*recorded)[0] == 1
    later.close()
    assert verify(session.directory) == []
    dataset = throwcollect.load(session.directory)
    first, second = dataset.throw(0), dataset.throw(1)
    assert first["landing_x_m"] == second["landing_x_m"]
    assert first["digest"] != second["digest"]
    card = (session.directory / "README.md").read_text()
    assert "no trial can be simulated again" in card
    assert "clients of sim_1" in card
    assert "collecting with it again" not in card


def test_sessions_of_other_configurations_are_refused(
    session: SessionDataset, recorded: tuple[EpisodeHeader, Samples]
) -> None:
    session.append(*recorded)
    session.close()
    with pytest.raises(ConfigError, match="was not recorded in a session of this configuration"):
        SessionDataset(session.directory, with_values(CONFIG, {"ball.mass_kg": 0.1}), name="sim_0")


@pytest.mark.parametrize("writes", [OpenShard, DatasetWriter])
def test_episode_after_one_that_cannot_be_written_takes_its_place(
    session: SessionDataset, recorded: tuple[EpisodeHeader, Samples], monkeypatch: pytest.MonkeyPatch, writes: type
) -> None:
    session.append(*recorded)
    with monkeypatch.context() as patch:

        def fail(*_: object, **__: object) -> None:
            raise DatasetError("no space left on device")

        patch.setattr(writes, "finish", fail)
        with pytest.raises(DatasetError, match="no space"):
            session.append(*recorded)
    if writes is OpenShard:
        assert verify(session.directory) == []
    assert session.append(*recorded)[0] == 1
    assert verify(session.directory) == []


def test_datasets_of_two_sessions_can_be_merged(
    session: SessionDataset, recorded: tuple[EpisodeHeader, Samples], tmp_path: Path
) -> None:
    other = SessionDataset(tmp_path / "other", CONFIG, name="sim_1")
    for dataset in (session, other):
        dataset.append(*recorded)
        dataset.close()
    merged = tmp_path / "merged"
    assert merge([session.directory, other.directory], merged).trials == 2
    assert verify(merged) == []


def test_dataset_carries_the_files_of_its_robot(tmp_path: Path) -> None:
    config = load(CONFIGS / "ur5.yaml")
    recording = record(config)
    for number in range(2):
        dataset = SessionDataset(tmp_path / "recorded", config, name="sim_0")
        assert dataset.append(*recording)[0] == number
        dataset.close()
    assert verify(tmp_path / "recorded") == []
