"""A dataset that ends with the trial at which enough have landed is the same however it is collected."""

from collections.abc import Callable
from pathlib import Path
from random import Random

import pyarrow.parquet as pq
import pytest

from throwcollect.collect.coordinator.collection import TrialCollection
from throwcollect.collect.coordinator.prefetch import Prefetch
from throwcollect.collect.coordinator.prepare import prepare
from throwcollect.collect.coordinator.resume import resume
from throwcollect.config.schema import Config
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import LossError
from throwcollect.sim.simulator import Simulator

LANDED = 12
CONFIG = Config.model_validate(
    {
        "name": "until",
        "seed": 3,
        "until": {"landed": LANDED},
        "sweep": {
            "sampler": "uniform",
            "parameters": {
                "task.duration_s": {"min": 0.5, "max": 1.2},
                "task.end.arm_right_4_joint": {"min": -1.6, "max": -0.3},
            },
        },
        "sim": {"engine": "ballistic"},
        "record": {"trials_per_shard": 3},
        "run": {"retries": 0, "replay": 0},
    }
)
Deliver = Callable[[int], Episode]


@pytest.fixture(scope="module")
def deliver(tmp_path_factory: pytest.TempPathFactory) -> Deliver:
    plan = prepare(CONFIG, tmp_path_factory.mktemp("plan") / "data", sweep_directory=Path())
    simulator = Simulator(CONFIG)
    made: dict[int, Episode] = {}

    def deliver(trial: int) -> Episode:
        if trial not in made:
            made[trial] = simulator.run(plan.trial(trial))
        return made[trial]

    return deliver


def collect(
    directory: Path,
    deliver: Deliver,
    *,
    random: Random,
    simulations: int = 1,
    kill_after: int | None = None,
    lost: frozenset[int] = frozenset(),
) -> set[int]:
    """Collect with simulations that end in any order; returns the trials that were run."""
    ran: set[int] = set()
    with TrialCollection.open(directory, say=lambda _: None) as collection:
        names = [f"/sim_{number}" for number in range(simulations)]
        for name in names:
            collection.join(name, name[1:])
        while not collection.finished:
            name = random.choice(names)
            if leased := collection.lease(name):
                ran.add(leased[0])
                if leased[0] in lost:
                    collection.refuse(name, leased[0], "it is lost")
                else:
                    assert collection.take_in(name, deliver(leased[0]))
            else:
                collection.check_next()
            if kill_after is not None and len(ran) >= kill_after:
                return ran
        collection.finish(meanwhile=lambda: None, say=lambda _: None)
    return ran


def raise_interrupt(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


def files_of(directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.iterdir() if path.suffix in (".mcap", ".parquet")}


@pytest.fixture(scope="module")
def undisturbed(deliver: Deliver, tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("undisturbed") / "data"
    prepare(CONFIG, directory, sweep_directory=Path())
    collect(directory, deliver, random=Random(0))
    return directory


def test_it_ends_with_the_trial_at_which_enough_have_landed(undisturbed: Path) -> None:
    outcomes = pq.read_table(undisturbed / "throws.parquet")["outcome"].to_pylist()
    assert outcomes.count("landed") == LANDED
    assert outcomes[-1] == "landed"
    assert 0 < outcomes.count("refused") < len(outcomes) - LANDED
    assert "refused" in outcomes[LANDED:]
    assert len(outcomes) % 3, "the last shard is not full"
    assert pq.read_table(undisturbed / "plan.parquet")["trial"].to_pylist() == list(range(len(outcomes)))
    assert verify(undisturbed) == []


@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_same_for_any_simulations_order_kills_and_losses(
    deliver: Deliver, undisturbed: Path, tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    random = Random(seed)
    monkeypatch.setattr(Prefetch, "count_for", lambda *_, **__: random.randrange(1, 5))
    prepare(CONFIG, tmp_path / "data", sweep_directory=Path())
    needed = len(pq.read_table(undisturbed / "plan.parquet"))
    simulations = random.choice([1, 2, 5])
    for _ in range(random.randrange(3)):
        ran = collect(
            tmp_path / "data", deliver, random=random, simulations=simulations, kill_after=random.randrange(1, 8)
        )
        assert max(ran) < needed
    if seed % 2:
        lost = frozenset(random.sample(range(needed), 5))
        try:
            ran = collect(tmp_path / "data", deliver, random=random, simulations=1, lost=lost)
        except LossError:
            assert len(pq.read_table(tmp_path / "data" / "plan.parquet")) >= needed
        resume(CONFIG, tmp_path / "data", sweep_directory=Path())
    collect(tmp_path / "data", deliver, random=random, simulations=simulations)
    assert files_of(tmp_path / "data") == files_of(undisturbed)


def test_a_kill_after_the_plan_was_cut_loses_nothing(
    deliver: Deliver, undisturbed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepare(CONFIG, tmp_path / "data", sweep_directory=Path())
    with monkeypatch.context() as killed:
        killed.setattr(DatasetWriter, "finish", raise_interrupt)
        with pytest.raises(KeyboardInterrupt):
            collect(tmp_path / "data", deliver, random=Random(0))
    assert (tmp_path / "data" / "plan.parquet").read_bytes() == (undisturbed / "plan.parquet").read_bytes()
    assert not collect(tmp_path / "data", deliver, random=Random(0))
    assert files_of(tmp_path / "data") == files_of(undisturbed)


def test_it_can_be_continued_until_more_have_landed(deliver: Deliver, undisturbed: Path, tmp_path: Path) -> None:
    fewer = CONFIG.model_copy(update={"until": type(CONFIG.until).model_validate({"landed": 5})})  # type: ignore[arg-type]
    prepare(fewer, tmp_path / "data", sweep_directory=Path())
    first = collect(tmp_path / "data", deliver, random=Random(0))
    resume(CONFIG, tmp_path / "data", sweep_directory=Path())
    assert not first & collect(tmp_path / "data", deliver, random=Random(0))
    assert files_of(tmp_path / "data") == files_of(undisturbed)


def test_without_enough_landings_it_ends_with_the_plan(deliver: Deliver, tmp_path: Path) -> None:
    prepare(CONFIG.model_copy(update={"trials": LANDED}), tmp_path / "data", sweep_directory=Path())
    collect(tmp_path / "data", deliver, random=Random(0))
    assert len(pq.read_table(tmp_path / "data" / "throws.parquet")) == LANDED
    assert verify(tmp_path / "data") == []
