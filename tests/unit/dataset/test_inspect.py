from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from throwcollect.dataset.inspect import info
from throwcollect.episode.episode_message import header_to_json
from throwcollect.episode.record import Contact, EpisodeHeader, Samples


def test_info_counts_trials_episodes_outcomes_samples_and_messages(collection: Any, tmp_path: Path) -> None:
    collection.refuse(5, "too fast")
    directory = collection.collect(tmp_path / "dataset", [0, 1, 2, 3, 4, 6], lost=[2])
    found = info(directory)
    assert (found.name, found.trials, found.episodes, found.shards) == ("quick", 7, 5, 3)
    assert found.outcomes == {"landed": 5, "lost": 1, "refused": 1}
    lengths = [collection.episode(trial).header.samples for trial in (0, 1, 3, 4, 6)]
    assert found.samples == sum(lengths)
    assert found.topics["/ball/odometry"] == sum(lengths)
    assert found.topics["/tf_static"] == 3
    assert found.duration_s == pytest.approx(sum(length - 1 for length in lengths) / 250)
    assert found.recordings_bytes == sum(path.stat().st_size for path in directory.glob("*.mcap"))
    landings = [collection.result(collection.episode(trial)).landing for trial in (0, 1, 3, 4, 6)]
    assert found.landing is not None
    assert found.landing["x_m"] == (
        min(each.position[0] for each in landings),
        max(each.position[0] for each in landings),
    )
    assert json.loads(json.dumps(asdict(found)))["outcomes"] == found.outcomes


def test_the_landing_area_of_info_is_that_of_throws_that_landed(collection: Any, tmp_path: Path) -> None:
    farthest = max(range(7), key=lambda trial: collection.result(collection.episode(trial)).landing.position[0])

    def touch(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
        """The ball of the farthest throw touches the arm in its flight."""
        if header.trial != farthest:
            return samples, header
        (held,) = header.contacts
        touched = Contact("arm_right_7_link", held.end_ns + 100_000_000, held.end_ns + 120_000_000)
        return samples, replace(header, contacts=(held, touched))

    found = info(collection.collect(tmp_path / "dataset", change=touch))
    assert found.outcomes == {"landed": 6, "self_hit": 1}
    others = [collection.result(collection.episode(trial)).landing for trial in range(7) if trial != farthest]
    assert found.landing is not None
    assert found.landing["x_m"][1] == max(each.position[0] for each in others)


def test_the_digest_of_a_dataset_is_that_of_all_episodes_in_order(collection: Any, dataset: Path) -> None:
    expected = hashlib.sha256()
    for trial in range(7):
        episode = collection.episode(trial)
        header = header_to_json(episode.header).encode()
        records = hashlib.sha256(episode.chunk.decompress()).digest()
        expected.update(hashlib.sha256(header + b"\0" + records).digest())
    assert info(dataset).digest == expected.hexdigest()


def test_the_digest_of_a_dataset_does_not_depend_on_the_size_of_shards(make_collection: Any, tmp_path: Path) -> None:
    one = make_collection().collect(tmp_path / "one")
    other = make_collection({"record": {"trials_per_shard": 2}}).collect(tmp_path / "other")
    assert info(one).digest == info(other).digest
