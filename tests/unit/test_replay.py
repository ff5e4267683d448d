from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.unit.dataset.conftest import Collection

from throwcollect.config.schema import Config
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.message_table import ChunkEncoder
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.replay import compare, verify_dataset
from throwcollect.robots.description import full_description

COUNT = 5
CONFIG = Config()
ENCODER = ChunkEncoder(Channels(CONFIG, full_description(CONFIG)), level=1)
SAMPLES = Samples(
    stamps_ns=16_000_000_000 + 4_000_000 * np.arange(COUNT),
    position=np.ones((COUNT, 32)),
    velocity=np.zeros((COUNT, 32)),
    effort=np.zeros((COUNT, 32)),
    object_position=np.ones((COUNT, 3)),
    object_orientation_xyzw=np.tile([0.0, 0.0, 0.0, 1.0], (COUNT, 1)),
    object_linear_velocity=np.zeros((COUNT, 3)),
    object_angular_velocity=np.zeros((COUNT, 3)),
)
HEADER = EpisodeHeader(0, 16_000_000_000, "landed", (Contact("spoon", 16_000_000_000, None),), (), COUNT)


def episode(samples: Samples = SAMPLES, header: EpisodeHeader = HEADER) -> Episode:
    return Episode(header, ENCODER.encode(samples)[0])


def test_an_episode_has_no_differences_from_itself_and_some_from_one_with_other_channels() -> None:
    assert compare(episode(), episode()).differences == ()
    further = Config.model_validate({"record": {"topics": ["joint_states", "ball/odometry", "clock"]}})
    with_clock = ChunkEncoder(Channels(further, full_description(further)), level=1).encode(SAMPLES)[0]
    found = compare(episode(), Episode(HEADER, with_clock))
    assert found.differences == ("other channels than joint states and ball differ",)


def test_a_difference_in_the_last_bit_is_reported_with_its_time_and_size() -> None:
    position = SAMPLES.object_position.copy()
    position[3, 1] = np.nextafter(1.0, 2.0)
    found = compare(episode(), episode(replace(SAMPLES, object_position=position)))
    assert found.differences == ("object_position: from 0.012 s on, by up to 2.22e-16",)
    assert found.stored != found.again


def test_different_contacts_and_fewer_samples_are_reported() -> None:
    header = replace(HEADER, contacts=(), samples=3)
    found = compare(episode(), episode(SAMPLES[:3], header))
    assert found.differences == (f"contacts: {HEADER.contacts} stored, () now", "samples: 5 stored, 3 now")


def test_throws_that_come_out_differently_are_found(tmp_path: Path) -> None:
    # No simulation has made these throws.
    directory = Collection({"sim": {"engine": "ballistic"}}).collect(tmp_path / "data", lost=[2])
    before = verify_dataset(directory, replay=0)
    after = verify_dataset(directory, replay=7)
    assert after[: len(before)] == before
    assert [(each.file, each.place) for each in after[len(before) :]] == [
        (f"quick_0000{trial // 3}.mcap", f"trial {trial}") for trial in (0, 1, 3, 4, 5, 6)
    ]
    assert all(each.problem.startswith("comes out differently: ") for each in after[len(before) :])


def test_a_few_throws_are_simulated_again_where_libraries_are_those_of_the_collection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # No simulation has made these throws.
    directory = Collection({"sim": {"engine": "ballistic"}}).collect(tmp_path / "data")
    monkeypatch.setattr("throwcollect.replay.SAMPLE", 2)
    assert sum("comes out differently" in each.problem for each in verify_dataset(directory)) == 2
    monkeypatch.setattr("throwcollect.replay.find_versions", lambda: {"numpy": "1.0"})
    assert verify_dataset(directory) == verify_dataset(directory, replay=0)
