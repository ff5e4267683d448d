"""Scores a learned map or a policy by throwing at targets in simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.config.task_config import TaskConfig
from throwcollect.dataset.throw import Throw
from throwcollect.learning.adapting import Adaptation, Method, adapt
from throwcollect.learning.aiming import aim
from throwcollect.learning.distilling import DistilledMap
from throwcollect.learning.learned_map import (
    Correction,
    KeyRole,
    LearnedMap,
    count_needed_throws,
    find_nearest,
    fit_throws,
    number_cells,
)
from throwcollect.learning.polynomial import Array
from throwcollect.learning.score import Adapted, Errors, PolicyScore, Score, ThrowAtTarget, Trained
from throwcollect.progress_log import log_progress
from throwcollect.side_by_side import limit_processes

SIZES = (30, 100, 300, 1000, 3000, 10_000)
"""Numbers of throws from which models are learned, to show how many throws a model needs."""
REAL_THROWS = (0, 1, 3, 5, 10)
"""Numbers of throws in another world that a model is adapted by."""
_APART = 1000
"""Added to the seed of targets, this gives the seed of throws to adapt by, so that these are no seed's targets."""


class Simulates(Protocol):
    """The part of `Simulator` that scoring needs; that room is above this one."""

    config: Config

    @property
    def find_refusal(self) -> Callable[[Mapping[str, float]], str | None]:
        """Returns why a throw would be refused; None if it would not."""

    @property
    def throw_many(self) -> Callable[..., Iterator[Throw]]:
        """Simulates throws, in order."""


def score_model(
    learned: LearnedMap,
    simulator: Simulates,
    *,
    count: int,
    seeds: range,
    world: Simulates | None,
    scatter: float,
    distilled: DistilledMap | None,
    processes: int,
) -> Score:
    """Throw at `count` targets of each seed, in the world of the dataset and in another one; see `Model.score`.

    If the map was adapted already, adapting to the other world begins with its correction, and the throws in the world
    of the dataset leave the correction out.
    """
    context = _find_nominal_context(learned)
    plain = learned.correct(None)
    given = np.tile(context, (count, 1))
    needed = count_needed_throws(len(learned.axes_of(KeyRole.PARAMETER)))
    sizes = [size for size in SIZES if needed <= size < len(learned.values)]
    throws: list[ThrowAtTarget] = []
    adapted_throws: list[ThrowAtTarget] = []
    # Misses by seed: of each size, then of the model itself, then of the distilled map.
    misses: list[list[Array]] = []
    there: dict[int, list[tuple[Method, Array]]] = {}
    for seed in seeds:
        targets = draw_targets(plain.carry_over(context), count, seed)
        maps = [*(_learn_from(plain, size, seed) for size in sizes), plain]
        lists = [aim(each, targets, given).parameters for each in maps]
        if distilled is not None:
            lists.append(distilled.aim(targets, given))
        places = _throw(learned, lists, given, simulator, processes)
        misses.append([each - targets for each in places])
        throws += _list_throws(targets, places[len(sizes)])
        if world is None:
            continue
        adaptations = _adapt_step_by_step(learned, world, seed, scatter, processes)
        targets, found = _throw_there(learned, adaptations, targets, world, processes)
        adapted_throws += _list_throws(targets, found[-1]) if found else []
        for (number, (_, each)), ends in zip(adaptations.items(), found, strict=False):
            there.setdefault(number, []).append((each.method, ends - targets))
    errors = [Errors.of(each, learned.targets) for each in zip(*misses, strict=True)]
    numbers = [*sizes, len(learned.values)]
    adapted = []
    for number, found_there in sorted(there.items()):
        # The method is the one that was chosen for most seeds.
        methods, missed = zip(*found_there, strict=True)
        method = max(methods, key=methods.count)
        adapted.append(Adapted(real_throws=number, method=method, errors=Errors.of(missed, learned.targets)))
    return Score(
        targets=count,
        seed=seeds[0],
        seeds=len(seeds),
        # There may be one element more in `errors`, the last one: that of the distilled map, which has no size.
        trained=[Trained(trained_on=size, errors=each) for size, each in zip(numbers, errors, strict=False)],
        distilled=None if distilled is None else errors[-1],
        throws=throws,
        scatter=scatter,
        adapted=adapted,
        adapted_throws=adapted_throws,
    )


def _adapt_step_by_step(
    learned: LearnedMap, world: Simulates, seed: int, scatter: float, processes: int
) -> dict[int, tuple[Correction, Adaptation]]:
    """Throw in another world, and adapt a map by more and more throws; the keys are the numbers of throws, from 0."""
    context = _find_nominal_context(learned)
    tries = spread_first(draw_targets(learned.carry_over(context), REAL_THROWS[-1], seed + _APART))
    given = np.tile(context, (len(tries), 1))
    parameters = aim(learned, tries, given).parameters
    [places] = _throw(learned, [parameters], given, world, processes)
    landed = np.isfinite(places).all(axis=1)
    # The second number of the seed makes this sequence independent of the sequence for targets.
    noise = scatter * np.random.default_rng((seed, 1)).standard_normal(places.shape)
    parameters, given, measured = parameters[landed], given[landed], (places + noise)[landed]
    numbers = sorted({min(number, len(measured)) for number in REAL_THROWS})
    return {
        number: adapt(learned, parameters[:number], given[:number], measured[:number], scatter=scatter)
        for number in numbers
    }


def _throw_there(
    learned: LearnedMap,
    adaptations: Mapping[int, tuple[Correction, Adaptation]],
    targets: Array,
    world: Simulates,
    processes: int,
) -> tuple[Array, list[Array]]:
    """Throw in another world at the targets that can be reached there, once with each adaptation.

    Returns:
        These targets, and for each adaptation the places where the throws ended, as `_throw` gives them; no places if
        there are no such targets.
    """
    given = np.tile(_find_nominal_context(learned), (len(targets), 1))
    worlds = [learned.correct(correction) for correction, _ in adaptations.values()]
    reachable = aim(worlds[-1], targets, given).reachable
    targets, given = targets[reachable], given[reachable]
    if not len(targets):
        return targets, []
    return targets, _throw(learned, [aim(each, targets, given).parameters for each in worlds], given, world, processes)


def draw_targets(landings: Array, count: int, seed: int) -> Array:
    """Draw targets evenly over the places that throws have reached.

    For each target, a cell is drawn in which a throw ended, a throw in the cell, and a point between this throw and the
    ones nearest to it.

    Args:
        landings: Where throws ended, shape ``(n, n_targets)``.
        count: Number of targets.
        seed: Seed of the choice.

    Returns:
        Shape ``(count, n_targets)``.
    """
    randomness = np.random.default_rng(seed)
    _, members = np.unique(number_cells(landings), axis=0, return_inverse=True)
    # In NumPy 2.0, the inverse has a second axis.
    members = members.reshape(-1)
    targets = np.empty((count, landings.shape[1]))
    for number in range(count):
        inside = np.flatnonzero(members == randomness.integers(members.max() + 1))
        chosen = landings[inside[randomness.integers(len(inside))]]
        near = find_nearest(((landings - chosen) ** 2).sum(axis=1), landings.shape[1] + 1)
        # The gaps between sorted random numbers are weights with the sum 1, and all such weights are equally probable.
        shares = np.diff(np.sort(randomness.random(len(near) - 1)), prepend=0.0, append=1.0)
        targets[number] = (shares[:, np.newaxis] * landings[near]).sum(axis=0)
    return targets


def spread_first(targets: Array) -> Array:
    """Order targets, ``(n, n_targets)``, so that the first few are far apart and show most about a world.

    The target nearest to the middle is first, as it is typical of all. Each further one is the target that is farthest
    from all before it.
    """
    squares = ((targets[:, np.newaxis] - targets) ** 2).sum(axis=2)
    order = [int(((targets - targets.mean(axis=0)) ** 2).sum(axis=1).argmin())]
    while len(order) < len(targets):
        order.append(int(squares[order].min(axis=0).argmax()))
    return targets[order]


def _find_nominal_context(learned: LearnedMap) -> Array:
    """Scaled context that the configuration has, shape ``(n_context,)``."""
    nominal = np.array([[axis.nominal for axis in learned.axes_of(KeyRole.CONTEXT)]], np.float64)
    inside: Array = np.clip(learned.scale(KeyRole.CONTEXT, nominal)[0], -1.0, 1.0)
    return inside


def _learn_from(learned: LearnedMap, size: int, seed: int) -> LearnedMap:
    """Learn a map from some throws of the dataset, drawn at random."""
    drawn = np.sort(np.random.default_rng((seed, 2)).permutation(len(learned.inputs))[:size])
    throws = (learned.values[drawn], learned.outputs[drawn], learned.efforts[drawn])
    return fit_throws(learned.axes, learned.targets, *throws)


def _throw(learned: LearnedMap, lists: Sequence[Array], given: Array, world: Simulates, processes: int) -> list[Array]:
    """Throw with some lists of parameters, all at once, as processes take a while to begin.

    Args:
        learned: Its axes are those of the parameters.
        lists: Scaled parameters, each of shape ``(n, n_parameters)``.
        given: Scaled context of each of these lists, shape ``(n, n_context)``.
        world: Simulates the throws.
        processes: Largest number of processes that simulate; there are fewer if throws are too few to be worth a start.

    Returns:
        For each list, where the throws ended, shape ``(n, n_targets)``, with NaN where one did not succeed.
    """
    keys = [axis.key for axis in (*learned.axes_of(KeyRole.PARAMETER), *learned.axes_of(KeyRole.CONTEXT))]
    parameters = learned.unscale(KeyRole.PARAMETER, np.concatenate(lists))
    values = np.hstack([parameters, np.tile(learned.unscale(KeyRole.CONTEXT, given), (len(lists), 1))])
    points = [dict(zip(keys, row, strict=True)) for row in values.tolist()]
    thrown = [number for number, point in enumerate(points) if world.find_refusal(point) is None]
    places = np.full((len(points), len(learned.targets)), np.nan)
    processes = limit_processes(processes, len(thrown))
    throws = world.throw_many([points[number] for number in thrown], processes=processes)
    for number, throw in log_progress(zip(thrown, throws, strict=True), len(thrown), "throw", "simulated"):
        places[number] = _find_end(throw, world.config.task, learned.targets)
    return np.split(places, len(lists))


def _find_end(throw: Throw, task: TaskConfig, columns: Sequence[str]) -> list[float]:
    """Find where a throw ended, in columns of its row; NaN if it did not succeed."""
    ends = [throw.row[column] for column in columns]
    shown = throw.outcome in (task.success, *task.informative) and None not in ends
    return ends if shown else [np.nan] * len(ends)


def _list_throws(targets: Array, places: Array) -> list[ThrowAtTarget]:
    return [
        ThrowAtTarget(target=target, place=place if np.isfinite(place).all() else None)
        for target, place in zip(targets.tolist(), places.tolist(), strict=True)
    ]


def score_policy(
    ends: Array, worlds: Mapping[str, Simulates], count: int, seeds: range, *, hit: float, processes: int
) -> list[PolicyScore]:
    """Let the policy of each world throw at targets.

    Args:
        ends: Where throws ended, over which targets are drawn evenly, shape ``(n, n_targets)``.
        worlds: Simulators of configurations with a policy, by how they are named.
        count: Number of targets of each seed; a model that was learned from these ends gets the same ones.
        seeds: Seeds of their choice.
        hit: Largest miss of a hit, in the unit of the targets.
        processes: How many processes simulate.
    """
    targets = np.vstack([draw_targets(ends, count, seed) for seed in seeds])
    found = []
    for name, world in worlds.items():
        task = world.config.task
        columns = [next(each.name for each in task.target_columns if each.of == end) for end in task.targets]
        aimed = [dict(zip(columns, row, strict=True)) for row in targets.tolist()]
        throws = world.throw_many([{}] * len(aimed), targets=aimed, processes=limit_processes(processes, len(aimed)))
        simulated = [*log_progress(throws, len(aimed), "throw", "simulated")]
        away = np.array([_find_end(throw, task, task.targets) for throw in simulated]) - targets
        found.append(
            PolicyScore(
                world=name,
                hit=hit,
                hits=float((np.linalg.norm(away, axis=1) <= hit).mean()),
                clipped=float(np.mean([throw.row["clipped_share"] for throw in simulated])),
                errors=Errors.of(np.split(away, len(seeds)), task.targets),
            )
        )
    return found
