"""A small campaign of attacks; `python -m tests.campaign` runs a long one."""

from pathlib import Path

import pytest

from tests.campaign import run
from tests.e2e.collection import FAST

pytestmark = pytest.mark.e2e


def test_a_small_campaign_detects_every_attack(tmp_path: Path) -> None:
    # Slow enough that signals arrive before the last trial ends, without the work of computing contacts.
    counts = run(seed=1, flip_count=40, kill_count=1, scratch=tmp_path, sim=f"{FAST}, real_time_factor: 5")
    assert {kind: count.missed for kind, count in counts.items()} == {"flips": [], "kills": []}
    assert counts["flips"].tried == 40
    assert counts["kills"].tried >= 1
