from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.unit.publish.export.conftest import MOVING, WITH_EPISODE, Export, throws_of

from throwcollect.dataset.inspect import info
from throwcollect.robots.talos import TALOS


@pytest.mark.parametrize(("rate_hz", "step"), [(None, 1), (50, 5)])
def test_exported_arrays_equal_the_samples_of_the_dataset(
    rate_hz: int | None, step: int, exported: Export, source: Path
) -> None:
    archives = [np.load(path) for path in sorted((exported("npz", rate_hz) / "trajectories").iterdir())]
    assert [archive["trial"].tolist() for archive in archives] == [[0, 2], [3, 4]]
    expected = dict(throws_of(source, step))
    assert list(expected) == WITH_EPISODE
    for archive in archives:
        assert archive["joints"].tolist() == list(TALOS.joints)
        assert archive["moving_joints"].tolist() == MOVING
        assert str(archive["digest_of_dataset"]) == info(source).digest
        offsets = archive["offsets"]
        for number, trial in enumerate(archive["trial"].tolist()):
            for name, values in expected[trial].items():
                assert np.array_equal(archive[name][offsets[number] : offsets[number + 1]], values), name
        assert {len(archive[name]) for name in expected[0]} == {offsets[-1]}
