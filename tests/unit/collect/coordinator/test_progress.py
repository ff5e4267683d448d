"""Messages about the progress of a collection."""

from dataclasses import replace

from throwcollect.collect.coordinator.progress import Progress

PROGRESS = Progress(10, 4, {"landed": 2, "recaught": 1, "lost": 1}, 2, 7.5, hung=["sim_1"])


def test_progress_reads_back_equal_from_its_message() -> None:
    assert Progress.read(PROGRESS.to_json()) == PROGRESS
    idle = replace(PROGRESS, throws_per_s=0.0, hung=[])
    assert Progress.read(idle.to_json()) == idle


def test_the_progress_line_counts_trials_or_throws_that_should_land() -> None:
    alone = replace(PROGRESS, total=1, ended=1, outcomes={"landed": 1}, simulations=1)
    assert alone.line == "1/1 throw: 1 landed, 0 failed, 1 simulation, 7.5 throws/s"
    assert PROGRESS.line == "4/10 throws: 2 landed, 1 failed, 1 lost, 2 simulations, 7.5 throws/s"
    assert PROGRESS.steps == (4, 10)
    until = replace(PROGRESS, wanted=5)
    assert until.line == "4 throws: 2/5 landed, 1 failed, 1 lost, 2 simulations, 7.5 throws/s"
    assert until.steps == (2, 5)
    assert replace(until, outcomes={"landed": 7}).steps == (5, 5)
    assert Progress.read(until.to_json()) == until
