from __future__ import annotations

from dataclasses import replace

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.message_table import ChunkEncoder
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.replay import compare
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
