from dataclasses import replace

from tests.unit.dataset.conftest import Collection

from throwcollect.dataset.row_result import row_result
from throwcollect.dataset.throws_table import Place, ThrowsTable
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.tasks.throw import Outcome


def held(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    return samples, replace(header, contacts=(Contact("spoon", header.start_ns, None),))


def not_finite(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    return replace(samples, effort=samples.effort * float("nan")), header


def test_results_come_back_from_the_table(collection: Collection) -> None:
    joints = tuple(collection.config.task.end)
    table = ThrowsTable(collection.plan.keys, joints)
    outcomes = set()
    for change in (None, held, not_finite):
        result = collection.result(collection.episode(2, change))
        row = table.row(2, collection.plan.trials[2].values, result, Place("a.mcap", 7, 9, "d"))
        (stored,) = table.table([row]).to_pylist()
        assert row_result(stored, joints) == result
        outcomes.add(result.outcome)
    assert outcomes == {Outcome.LANDED, Outcome.NOT_RELEASED, Outcome.TRACKING_FAILED}
