from __future__ import annotations

import numpy as np
import pytest

from throwcollect.dataset.journal import JournalLine
from throwcollect.report.throughput import measure_throughput


def test_throughput_leaves_pauses_out() -> None:
    events = [
        JournalLine("opened", 100.0),
        *(JournalLine("commit", 100.0 + i) for i in range(1, 11)),
        JournalLine("fail", 112.0),
        JournalLine("opened", 9000.0),
        *(JournalLine("commit", 9000.0 + i) for i in range(1, 9)),
    ]
    found = measure_throughput(events)
    assert found is not None
    assert (found.commits, found.edges_s[-1], found.resumed_s) == (18, 20.0, (12.0,))
    assert (found.failed_s, found.lost_s) == ((12.0,), ())
    assert (found.rate_per_s * np.diff(found.edges_s)).sum() == pytest.approx(18)
    assert measure_throughput([]) is None
    assert measure_throughput([JournalLine("commit", 5.0)]) is None
