"""What a dataset holds, in numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from throwcollect.dataset.data_card import count_outcomes
from throwcollect.dataset.digest import combined_digest
from throwcollect.dataset.journal import collected_s
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import DatasetError, LossError
from throwcollect.tasks.throw import Outcome
from throwcollect.wording import counted


@dataclass(frozen=True)
class Info:
    """Summary of a dataset.

    Attributes:
        name: Name of the collection.
        trials: Number of planned trials.
        episodes: Number of trials with an episode.
        outcomes: Number of trials of each outcome, most frequent first.
        wanted: Number of throws that were to land; None if there was no such number.
        landing: Lowest and highest ``x_m`` and ``y_m`` at which a ball landed [m], in world; None if none did.
        samples: Number of samples in all episodes.
        duration_s: Simulated time of all episodes together [s].
        shards: Number of MCAP files.
        size_bytes: Size of all files of the dataset.
        recordings_bytes: Size of the MCAP files.
        topics: Number of messages of each topic.
        digest: Hash over all episodes in order of trials, as it was written.
        wall_s: Real time for which it was collected, without pauses [s]; None if no journal tells.
    """

    name: str
    trials: int
    episodes: int
    outcomes: Mapping[str, int]
    wanted: int | None
    landing: Mapping[str, tuple[float, float]] | None
    samples: int
    duration_s: float
    shards: int
    size_bytes: int
    recordings_bytes: int
    topics: Mapping[str, int]
    digest: str
    wall_s: float | None = None

    def as_dict(self) -> dict[str, object]:
        """The same for JSON."""
        return asdict(self)


def info(directory: Path) -> Info:
    """Summary of a dataset, from its tables; `verify` says whether they are right.

    Args:
        directory: Its directory.

    Raises:
        DatasetError: If the directory holds no finished dataset, or its tables are damaged.
        ConfigError: If its ``config.yaml`` is wrong.
    """
    return summary(Dataset.open(directory))


def summary(dataset: Dataset) -> Info:
    """Summary of an open dataset.

    Raises:
        DatasetError: If its metadata lack a field, or its directory cannot be read.
    """
    directory = dataset.directory
    try:
        shards = dataset.bag["relative_file_paths"]
        topics = {
            each["topic_metadata"]["name"]: each["message_count"] for each in dataset.bag["topics_with_message_count"]
        }
        digest = dataset.bag["custom_data"]["throwcollect.digest"]
    except (KeyError, TypeError) as error:
        raise DatasetError(f"{directory / 'metadata.yaml'}: {error} is missing") from error
    try:
        sizes = {path.name: path.stat().st_size for path in directory.iterdir() if path.is_file()}
    except OSError as error:
        raise DatasetError(f"{directory}: cannot be read: {error.strerror}") from error
    samples = sum(count for count in dataset.throws["samples"].to_pylist() if count is not None)
    return Info(
        name=dataset.config.name,
        trials=len(dataset.throws),
        episodes=len(dataset),
        outcomes=count_outcomes(dataset.throws),
        wanted=dataset.config.until.landed if dataset.config.until else None,
        landing=_landing(dataset.throws),
        samples=samples,
        duration_s=(samples - len(dataset)) / dataset.config.record.rate_hz,
        shards=len(shards),
        size_bytes=sum(sizes.values()),
        recordings_bytes=sum(size for name, size in sizes.items() if name.endswith(".mcap")),
        topics=topics,
        digest=digest,
        wall_s=collected_s(directory),
    )


def loss(outcomes: Mapping[str, int], *, hint: str | None) -> LossError | None:
    """The error that says that trials of a finished dataset are lost; None if none is.

    Args:
        outcomes: Number of trials of each outcome.
        hint: How to go on.
    """
    lost, all_of_them = outcomes.get(Outcome.LOST.value, 0), sum(outcomes.values())
    if not lost:
        return None
    verb = "is" if lost == 1 else "are"
    return LossError(f"{lost} of {counted(all_of_them, 'trial')} {verb} lost; throws.parquet says why", hint=hint)


def _landing(throws: pa.Table) -> Mapping[str, tuple[float, float]] | None:
    limits = {axis: pc.min_max(throws[f"landing_{axis}"]).as_py() for axis in ("x_m", "y_m")}
    if limits["x_m"]["min"] is None:
        return None
    return {axis: (each["min"], each["max"]) for axis, each in limits.items()}


def digest(directory: Path) -> str:
    """Hash over all episodes in order of trials, recomputed from their bytes.

    Args:
        directory: Directory of the dataset.

    Raises:
        DatasetError: If an episode is damaged, or the digest of one or of all is not what the dataset says.
        ConfigError: If its ``config.yaml`` is wrong.
    """
    dataset = Dataset.open(directory)
    said = dict(zip(dataset.throws["trial"].to_pylist(), dataset.throws["digest"].to_pylist(), strict=True))
    digests = []
    for episode in dataset:
        trial = episode.header.trial
        try:
            episode.check_records()
        except DatasetError as error:
            raise DatasetError(f"{directory}: trial {trial}: {error}") from error
        if episode.digest != said[trial]:
            raise DatasetError(f"{directory}: trial {trial}: digest {episode.digest}", expected=f"{said[trial]}")
        digests.append(episode.digest)
    combined = combined_digest(digests)
    written = dataset.bag.get("custom_data", {}).get("throwcollect.digest")
    if combined != written:
        raise DatasetError(f"{directory}: digest {combined}", expected=f"{written} as metadata.yaml says")
    return combined
