"""Tests that Fast DDS makes flaky: the only ones that are run again if they fail."""

from collections.abc import Iterable

import pytest

from throwcollect.ros.middleware import Middleware

FLAKY = pytest.mark.flaky(
    reruns=2, reason="on Fast DDS, nodes at times do not find each other on a busy machine; a run starts them again"
)


def mark_flaky(items: Iterable[pytest.Item]) -> None:
    """Mark tests as flaky if this process is on Fast DDS; pytest-rerunfailures runs what fails twice more."""
    if Middleware.of_process().is_fast_dds:
        for item in items:
            item.add_marker(FLAKY)
