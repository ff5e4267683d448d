"""Components of the catalogue in the state of the server."""

from pathlib import Path

import pytest
from tests.unit.serve.conftest import CONFIG

from throwcollect.serve.catalogue import Catalogue
from throwcollect.serve.state import Lookout

_SWEPT = "sweep: {{sampler: {sampler}, parameters: {{{parameters}}}}}\n"
_DURATION = "task.duration_s: {min: 1.0, max: 1.2}"
_HEIGHT = "scene.landing_height_m: {min: 0, max: 0.5}"


@pytest.mark.parametrize(
    ("sweep", "targets"),
    [
        ("", []),
        (_SWEPT.format(sampler="uniform", parameters=_DURATION), []),
        (_SWEPT.format(sampler="sobol", parameters=_DURATION), ["distance_m", "hit_angle_rad"]),
        (
            _SWEPT.format(sampler="sobol", parameters=f"{_DURATION}, {_HEIGHT}"),
            ["distance_m", "height_m", "hit_angle_rad"],
        ),
    ],
)
def test_the_state_lists_the_possible_targets_of_a_collection(tmp_path: Path, sweep: str, targets: list[str]) -> None:
    config = tmp_path / "small.yaml"
    config.write_text(CONFIG + sweep)
    catalogue = tmp_path / "catalogue.yaml"
    catalogue.write_text("components: {throws: {config: small.yaml}, talos: {session: small.yaml}}\n")
    lookout = Lookout(Catalogue.read(catalogue))
    assert [each.targets for each in lookout.look().components] == [targets, []]
    # The file may be damaged later; the error then comes when an instance is started.
    config.write_text("name: [")
    assert lookout.look().components[0].targets == []
