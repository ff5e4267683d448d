from dataclasses import replace

from tests.unit.dataset.conftest import Collection

from throwcollect.dataset.throws_table import Place, ThrowsTable
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.tasks.throw.outcome import ThrowOutcome


def held(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    return samples, replace(header, contacts=(Contact("spoon", header.start_ns, None),))


def not_finite(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    return replace(samples, effort=samples.effort * float("nan")), header


def test_results_come_back_from_the_table(collection: Collection) -> None:
    table = ThrowsTable.of(collection.plan)
    outcomes = set()
    for change in (None, held, not_finite):
        result = collection.result(collection.episode(2, change))
        row = table.row(collection.plan.trials[2], result, Place("a.mcap", 7, 9, "d"))
        (stored,) = table.table([row]).to_pylist()
        assert table.result(stored) == result
        outcomes.add(result.outcome)
    assert outcomes == {ThrowOutcome.LANDED, ThrowOutcome.NOT_RELEASED, ThrowOutcome.TRACKING_FAILED}
