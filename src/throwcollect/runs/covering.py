"""Collects one dataset after the other, each with throws that are aimed where those before have landed seldom."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from throwcollect.config.loader import load_locating_errors
from throwcollect.config.schema import Config
from throwcollect.config.sweep import SweepConfig
from throwcollect.coordinator.onlooker import SILENT, Onlooker
from throwcollect.coordinator.resume import is_complete
from throwcollect.dataset.carried_robot import carry_robot, config_text
from throwcollect.dataset.directory import ROBOT
from throwcollect.dataset.manifest import is_begun
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError, Problem
from throwcollect.files import write_file
from throwcollect.runs.preparation import prepare, resume
from throwcollect.sweep.point_file import encode_points


@dataclass(frozen=True)
class Round:
    """One of the datasets, with the files that it is collected from.

    Attributes:
        config: Its configuration, which `throwcollect up` takes, too.
        list: The list of its trials; only the first round has none.
        directory: The dataset.
    """

    config: Path
    list: Path
    directory: Path

    @classmethod
    def of(cls, directory: Path, number: int) -> Round:
        """Name the files of a round, whose number begins at 1."""
        name = f"round_{number:02}"
        return cls(directory / f"{name}.yaml", directory / f"{name}.parquet", directory / name)


def cover(
    path: Path,
    directory: Path,
    *,
    rounds: int,
    overrides: Sequence[str] = (),
    processes: int = 1,
    onlooker: Onlooker = SILENT,
    interruptions: Callable[[], int] = lambda: 0,
) -> list[Path]:
    """Spread the throws of a configuration evenly over the cells of its `sweep.target`.

    The first round has the trials that the configuration draws; the throws of each further round are aimed at the cells
    in which few throws of all rounds before have landed. Rounds that are there already are kept or continued, so the
    same call goes on after an interruption, and adds rounds if `rounds` is larger.

    Args:
        path: The configuration's file. `trials` is the number of throws of all rounds together.
        directory: Directory of the rounds.
        rounds: Number of rounds, 2 or more.
        overrides: Keys to change: ``key=value`` pairs.
        processes: Number of processes that may check the trials of a large plan.
        onlooker: Receives the progress.
        interruptions: How often the user has asked to stop.

    Returns:
        The directories of the datasets, in order.
    """
    with load_locating_errors(path, overrides) as config:
        trials = _check(config, rounds)
        directory.mkdir(parents=True, exist_ok=True)
        datasets: list[Path] = []
        for number in range(1, rounds + 1):
            each = Round.of(directory, number)
            if not is_begun(each.directory):
                count = trials // rounds + (number <= trials % rounds)
                _write(each, config, datasets, count=count, number=number)
            onlooker.say(f"round {number} of {rounds}: {each.directory}")
            _collect(each, processes, onlooker, interruptions)
            datasets.append(each.directory)
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


def _write(each: Round, config: Config, before: Sequence[Path], *, count: int, number: int) -> None:
    """Write the configuration of a round and, from the second one on, the list of its trials."""
    # Trials of the same number would have the same seed otherwise.
    changes: dict[str, object] = {"seed": (config.seed + number - 1) % 2**32, "trials": count}
    if before:
        from throwcollect.learning.covering import choose_throws

        points = choose_throws(config, [Dataset.open(each) for each in before], count=count, number=number)
        write_file(each.list, encode_points(points))
        target = config.sweep.target
        sweep = SweepConfig(sampler="list", file=each.list.name, target=target, feasibility=config.sweep.feasibility)
        changes |= {"sweep": sweep, "trials": None}
    if not (each.config.parent / ROBOT).exists():
        carry_robot(config, each.config.parent)
    write_file(each.config, config_text(config.model_copy(update=changes)).encode())


def _collect(each: Round, processes: int, onlooker: Onlooker, interruptions: Callable[[], int]) -> None:
    """Collect a round, or what is left of it."""
    if is_complete(each.directory):
        return
    if is_begun(each.directory):
        run = resume(each.directory, processes=processes, onlooker=onlooker)
    else:
        run = prepare(each.config, output=each.directory, processes=processes, onlooker=onlooker)
    if run is not None:
        with run:
            run.collect(interruptions=interruptions)
