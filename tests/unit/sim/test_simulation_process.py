"""A process makes a simulation ahead, before the node that takes it is forked off."""

from collections.abc import Iterator
from unittest.mock import Mock

import pytest

from throwcollect.config.schema import Config
from throwcollect.sim import simulation_process

CONFIG = Config.model_validate({"sim": {"engine": "ballistic"}})
OTHER = Config.model_validate({"sim": {"engine": "ballistic"}, "ball": {"mass_kg": 0.2}})


@pytest.fixture(autouse=True)
def nothing_made() -> Iterator[None]:
    simulation_process._made.clear()
    yield
    simulation_process._made.clear()


def test_a_simulation_made_ahead_is_taken_once() -> None:
    simulation_process.make_ahead(CONFIG)
    [made] = simulation_process._made
    assert simulation_process._take(CONFIG.model_copy()) is made
    assert simulation_process._take(CONFIG) is not made


def test_a_simulation_made_ahead_for_another_configuration_is_closed() -> None:
    simulation_process.make_ahead(OTHER)
    [made] = simulation_process._made
    made.world.close = Mock()
    assert simulation_process._take(CONFIG).config == CONFIG
    made.world.close.assert_called_once_with()


def test_a_world_that_cannot_be_forked_is_not_made_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation_process.load_member("engines", "ballistic"), "can_be_forked", False)
    simulation_process.make_ahead(CONFIG)
    assert not simulation_process._made
