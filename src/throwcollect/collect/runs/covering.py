"""Collects one dataset after the other, each with throws that are aimed where those before have landed seldom."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from throwcollect.collect.coordinator.reporter import SILENT, Reporter
from throwcollect.collect.coordinator.resume import is_complete
from throwcollect.collect.runs.preparation import prepare, resume
from throwcollect.config.loader import load_locating_errors
from throwcollect.config.schema import Config
from throwcollect.config.sweep import SweepConfig
from throwcollect.dataset.carried_robot import carry_robot, config_text
from throwcollect.dataset.directory import ROBOT, is_begun
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError, Problem
from throwcollect.files import write_file
from throwcollect.plan.point_file import encode_points


def cover(
    path: Path,
    directory: Path,
    *,
    rounds: int,
    overrides: Sequence[str] = (),
    processes: int = 1,
    reporter: Reporter = SILENT,
    interruptions: Callable[[], int] = lambda: 0,
) -> list[Path]:
    """Spread the throws of a configuration evenly over the cells of its `sweep.target`.

    The first round has the trials that the configuration draws; the throws of each further round are aimed at the cells
    in which few throws of all rounds before have landed. Rounds that are there already are kept or continued, so the
    same call goes on after an interruption, and adds rounds if `rounds` is larger. Next to each dataset, such as
    ``round_02``, lie its configuration, which `throwcollect up` takes, too, and the list of its trials, which only the
    first one lacks.

    Args:
        path: The configuration's file. `trials` is the number of throws of all rounds together.
        directory: Directory of the rounds.
        rounds: Number of rounds, 2 or more.
        overrides: Keys to change: ``key=value`` pairs.
        processes: Number of processes that may check the trials of a large plan.
        reporter: Receives the progress.
        interruptions: How often the user has asked to stop.

    Returns:
        The directories of the datasets, in order.
    """
    with load_locating_errors(path, overrides) as config:
        trials = _check(config, rounds)
        directory.mkdir(parents=True, exist_ok=True)
        datasets: list[Path] = []
        for number in range(1, rounds + 1):
            each = directory / f"round_{number:02}"
            if not is_begun(each):
                count = trials // rounds + (number <= trials % rounds)
                _write(each, config, datasets, count=count, number=number)
            reporter.say(f"round {number} of {rounds}: {each}")
            _collect(each, processes, reporter, interruptions)
            datasets.append(each)
    return datasets


def _check(config: Config, rounds: int) -> int:
    """Check that a configuration can be covered; return the number of its trials."""
    needs = {
        "sweep.target": config.sweep.target is not None,
        "trials": config.trials is not None and config.trials >= rounds,
        "sweep.parameters": bool(config.sweep.parameters),
    }
    for key, there in needs.items():
        if not there:
            raise ConfigError([Problem(f"missing, or too small for {rounds} rounds", key=key)])
    if config.until is not None:
        raise ConfigError([Problem("should be left out, as each round has a number of trials", key="until")])
    return config.trials or 0


def _write(each: Path, config: Config, before: Sequence[Path], *, count: int, number: int) -> None:
    """Write the configuration of a round and, from the second one on, the list of its trials."""
    points_file = each.with_suffix(".parquet")
    # Trials of the same number would have the same seed otherwise.
    changes: dict[str, object] = {"seed": (config.seed + number - 1) % 2**32, "trials": count}
    if before:
        from throwcollect.learning.covering import choose_throws

        points = choose_throws(config, [Dataset.open(one) for one in before], count=count, number=number)
        write_file(points_file, encode_points(points))
        target = config.sweep.target
        sweep = SweepConfig(sampler="list", file=points_file.name, target=target, feasibility=config.sweep.feasibility)
        changes |= {"sweep": sweep, "trials": None}
    if not (each.parent / ROBOT).exists():
        carry_robot(config, each.parent)
    write_file(each.with_suffix(".yaml"), config_text(config.model_copy(update=changes)).encode())


def _collect(each: Path, processes: int, reporter: Reporter, interruptions: Callable[[], int]) -> None:
    """Collect a round, or what is left of it."""
    if is_complete(each):
        return
    if is_begun(each):
        run = resume(each, processes=processes, reporter=reporter)
    else:
        run = prepare(each.with_suffix(".yaml"), output=each, processes=processes, reporter=reporter)
    if run is not None:
        with run:
            run.collect(interruptions=interruptions)
