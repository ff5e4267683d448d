"""Everything that a report says, before any of it is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from throwcollect.config.sweep import LANDING_HEIGHT
from throwcollect.dataset.directory import JOURNAL
from throwcollect.dataset.inspect import Info, summary
from throwcollect.dataset.journal import read_journal
from throwcollect.dataset.reader import Dataset
from throwcollect.report.coverage import Coverage, coverage
from throwcollect.report.episodes import (
    BallPath,
    JointMotion,
    Residuals,
    ball_paths,
    example_trials,
    joint_motion,
    residuals,
)
from throwcollect.report.failures import Failure, failures
from throwcollect.report.landing import Landings, landings
from throwcollect.report.limits import KINDS, JointPeaks, joint_peaks
from throwcollect.report.outcomes import LANDED, Outcomes
from throwcollect.report.provenance import config_text, provenance
from throwcollect.report.swept_keys import Parameter, parameters
from throwcollect.report.throughput import Throughput, throughput


@dataclass(frozen=True)
class Facts:
    """What a report on a dataset says.

    Attributes:
        info: Its summary.
        landing_height_m: Height of the landing plane [m]; None if it was swept.
        outcomes: Outcomes of all trials.
        landings: Throws that landed.
        coverage: Throws in cells of targets; None if none landed as planned.
        parameters: Swept keys.
        failures: Why throws failed.
        peaks: How close joints came to their limits, by kind of limit.
        residuals: How ballistic the flights are.
        paths: The ball in a few throws.
        motion: The joints of one of them; None without an episode.
        throughput: How fast it was collected; None if no journal says so.
        provenance: Where it came from, by name.
        config_text: Its ``config.yaml``.
    """

    info: Info
    landing_height_m: float | None
    outcomes: Outcomes
    landings: Landings
    coverage: Coverage | None
    parameters: tuple[Parameter, ...]
    failures: tuple[Failure, ...]
    peaks: Mapping[str, tuple[JointPeaks, ...]]
    residuals: Residuals
    paths: tuple[BallPath, ...]
    motion: JointMotion | None
    throughput: Throughput | None
    provenance: Mapping[str, str]
    config_text: str


def gather(dataset: Dataset) -> Facts:
    """Facts of a dataset.

    Raises:
        DatasetError: If a table or an episode is damaged.
    """
    throws = dataset.throws
    info = summary(dataset)
    outcomes = Outcomes.of(throws["outcome"].to_pylist())
    landed = landings(throws, outcomes)
    planned = landed[outcomes.are(LANDED)[landed.trial]]
    examples = example_trials(dataset, planned, outcomes)
    rows = zip(*(throws[name].to_pylist() for name in ("trial", "outcome", "reason")), strict=True)
    return Facts(
        info=info,
        landing_height_m=None if LANDING_HEIGHT in dataset.plan.keys else dataset.config.scene.landing_height_m,
        outcomes=outcomes,
        landings=landed,
        coverage=coverage(planned, throws, target=dataset.config.sweep.target),
        parameters=parameters(dataset.config, throws, outcomes),
        failures=failures(rows),
        peaks={kind: joint_peaks(throws, kind) for kind in KINDS},
        residuals=residuals(dataset),
        paths=tuple(ball_paths(dataset, examples)),
        motion=joint_motion(dataset, _middle(examples, outcomes)) if examples else None,
        throughput=throughput(read_journal(dataset.directory / JOURNAL)),
        provenance=provenance(dataset, info),
        config_text=config_text(dataset),
    )


def _middle(examples: tuple[int, ...], outcomes: Outcomes) -> int:
    """Of the examples that landed the one in the middle; the first of all if none did."""
    landed = [trial for trial in examples if outcomes.are(LANDED)[trial]]
    return landed[len(landed) // 2] if landed else examples[0]
