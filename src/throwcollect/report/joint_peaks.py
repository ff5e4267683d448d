"""How close the joints came to their limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from throwcollect.report.plotted_points import read_numbers

KINDS = ("position", "velocity", "effort")


@dataclass(frozen=True)
class JointPeaks:
    """Peaks of one kind in the trials in which one joint came closest to its limit.

    Attributes:
        joint: The joint.
        count: In how many trials it was this joint.
        quartiles: Lowest, first quartile, median, third quartile and highest of its peaks, divided by the limit [-].
        reached: In how many of them the limit was reached or passed.
    """

    joint: str
    count: int
    quartiles: tuple[float, float, float, float, float]
    reached: int


def summarise_peaks(throws: pa.Table, kind: str) -> tuple[JointPeaks, ...]:
    """Summarise the peaks of one of `KINDS` by joint; the joint that came closest to its limit comes first."""
    shares = read_numbers(throws, f"{kind}_peak_share")
    joints = np.array(throws[f"{kind}_peak_joint"].to_pylist(), dtype=object)
    measured = np.isfinite(shares)
    peaks = []
    for joint in sorted({str(name) for name in joints[measured]}):
        own = shares[measured & (joints == joint)]
        low, first, median, third, high = np.percentile(own, [0, 25, 50, 75, 100]).tolist()
        peaks.append(JointPeaks(joint, len(own), (low, first, median, third, high), int((own >= 1).sum())))
    return tuple(sorted(peaks, key=lambda each: (-each.quartiles[-1], each.joint)))
