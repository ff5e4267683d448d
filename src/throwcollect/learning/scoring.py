"""Scores a learned map by throwing at targets in simulation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.dataset.throw import Throw
from throwcollect.learning.adapting import Adaptation, adapt, adapt_by_nothing
from throwcollect.learning.aiming import Choice, aim
from throwcollect.learning.fitting import enough_throws, fit_throws
from throwcollect.learning.learned_map import LearnedMap, Role, no_correction
from throwcollect.learning.score import Adapted, Errors, Score, ThrowAtTarget, Trained

Array = NDArray[np.float64]

SIZES = (30, 100, 300, 1000, 3000, 10_000)
"""Numbers of throws that models are learned from, to see how many it takes."""
REAL_THROWS = (0, 1, 3, 5, 10)
"""Numbers of throws in another world that a model is adapted by."""
_CELL = 0.05


class Simulates(Protocol):
    """What throws; `Simulator` is one."""

    config: Config

    def find_refusal(self, values: Mapping[str, float]) -> str | None:
        """Say why a throw would be refused."""
        ...

    def throw_many(self, points: Iterable[Mapping[str, float]], *, processes: int = 1) -> Iterator[Throw]:
        """Simulate throws, in order."""
        ...


def score_model(
    learned: LearnedMap,
    simulator: Simulates,
    *,
    count: int,
    seed: int,
    world: Simulates | None,
    scatter: float,
    error: float,
    latents_count: bool,
    processes: int,
) -> Score:
    """Throw at targets, in the world of the dataset and in another one.

    Args:
        learned: The map; of one that was adapted already, the throws in the other world begin with that, and those in
            the world of the dataset leave it out.
        simulator: Simulates the world of the dataset.
        count: Number of targets.
        seed: Seed of their choice, of the throws that smaller models are learned from, and of the noise.
        world: Simulates the other world; None for none.
        scatter: Standard deviation of noise on what is measured of throws in the other world.
        error: What the map itself is off by, as a standard deviation.
        latents_count: Whether latents have an effect that is worth knowing.
        processes: How many processes simulate.
    """
    context = _nominal_context(learned)
    plain = learned.correct(no_correction(learned.axes, learned.targets))
    targets = draw_targets(plain.carry_over(context), count, seed)
    sizes = [*(size for size in SIZES if size < len(learned.values)), len(learned.values)]
    maps = {size: smaller for size in sizes if (smaller := _learn_from(plain, size, seed)) is not None}
    loops = _throw_at(list(maps.values()), targets, context, simulator, processes)
    trained = [
        Trained(trained_on=size, errors=Errors.of(_distances(places, targets)))
        for size, (_, places) in zip(maps, loops, strict=True)
    ]
    adapted: list[Adapted] = []
    adapted_throws: list[ThrowAtTarget] = []
    if world is not None:
        tries = draw_targets(learned.carry_over(context), REAL_THROWS[-1], seed + 1)
        [(parameters, places)] = _throw_at([learned], tries, context, world, processes)
        landed = np.isfinite(places).all(axis=1)
        noise = scatter * np.random.default_rng((seed, 1)).standard_normal(places.shape)
        adaptations = _adapt_step_by_step(
            learned,
            learned.scale(Role.PARAMETER, parameters[landed]),
            (places + noise)[landed],
            scatter=float(np.hypot(scatter, error)),
            latents_count=latents_count,
        )
        worlds = [learned.correct(each.correction) for each in adaptations.values()]
        given = np.repeat(context[np.newaxis], len(targets), axis=0)
        reachable = targets[aim(worlds[-1], targets, given).reachable]
        if len(reachable):
            found = _throw_at(worlds, reachable, context, world, processes)
            adapted = [
                Adapted(real_throws=number, method=each.method, errors=Errors.of(_distances(places, reachable)))
                for (number, each), (_, places) in zip(adaptations.items(), found, strict=True)
            ]
            adapted_throws = _list_throws(reachable, found[-1][1])
    return Score(
        targets=count,
        seed=seed,
        trained=trained,
        throws=_list_throws(targets, loops[-1][1]),
        scatter=scatter,
        adapted=adapted,
        adapted_throws=adapted_throws,
    )


def _adapt_step_by_step(
    learned: LearnedMap, parameters: Array, measured: Array, *, scatter: float, latents_count: bool
) -> dict[int, Adaptation]:
    """Adapt a map by more and more throws; the keys are the numbers of throws, from 0."""
    context = np.repeat(_nominal_context(learned)[np.newaxis], len(measured), axis=0)
    found = {0: adapt_by_nothing(learned)}
    for number in sorted({min(number, len(measured)) for number in REAL_THROWS} - {0}):
        found[number] = adapt(
            learned,
            parameters[:number],
            context[:number],
            measured[:number],
            scatter=scatter,
            latents_count=latents_count,
        )
    return found


def draw_targets(landings: Array, count: int, seed: int) -> Array:
    """Draw targets evenly over what throws have reached.

    A cell of 5 cm is drawn among those in which a throw ended, a throw in it, and a point between that throw and the
    ones nearest to it.

    Args:
        landings: Where throws ended, shape ``(n, n_targets)``.
        count: Number of targets.
        seed: Seed of the choice.

    Returns:
        Shape ``(count, n_targets)``.
    """
    randomness = np.random.default_rng(seed)
    cells = np.floor(landings / _CELL).astype(np.int64)
    _, members = np.unique(cells, axis=0, return_inverse=True)
    members = members.reshape(-1)
    targets = np.empty((count, landings.shape[1]))
    for number in range(count):
        inside = np.flatnonzero(members == randomness.integers(members.max() + 1))
        chosen = landings[inside[randomness.integers(len(inside))]]
        near = np.argsort(((landings - chosen) ** 2).sum(axis=1), kind="stable")[: landings.shape[1] + 1]
        shares = np.diff(np.sort(randomness.random(len(near) - 1)), prepend=0.0, append=1.0)
        targets[number] = (shares[:, np.newaxis] * landings[near]).sum(axis=0)
    return targets


def _nominal_context(learned: LearnedMap) -> Array:
    """Scaled values of the configuration for what is given with targets, shape ``(n_context,)``."""
    nominal = np.array([[axis.nominal for axis in learned.axes_of(Role.CONTEXT)]], np.float64)
    inside: Array = np.clip(learned.scale(Role.CONTEXT, nominal)[0], -1.0, 1.0)
    return inside


def _learn_from(learned: LearnedMap, size: int, seed: int) -> LearnedMap | None:
    """The map that some throws of the dataset give, drawn at random; None if they are too few."""
    if size == len(learned.inputs):
        return learned
    if not enough_throws(size, len(learned.axes_of(Role.PARAMETER))):
        return None
    drawn = np.sort(np.random.default_rng((seed, 2)).permutation(len(learned.inputs))[:size])
    fit = fit_throws(
        learned.kind,
        learned.axes,
        learned.targets,
        learned.values[drawn],
        learned.outputs[drawn],
        learned.efforts[drawn],
    )
    return fit.learned


def _throw_at(
    maps: Sequence[LearnedMap], targets: Array, context: Array, world: Simulates, processes: int
) -> list[tuple[Array, Array]]:
    """Aim at targets by each of some maps, and throw.

    All throws are simulated together, as processes take a while to begin.

    Returns:
        For each map: parameters in the units of their keys, shape ``(n, n_parameters)``; and where the throws ended,
        shape ``(n, n_targets)``, with NaN where one did not succeed.
    """
    given = np.repeat(context[np.newaxis], len(targets), axis=0)
    parameters = [
        learned.unscale(Role.PARAMETER, aim(learned, targets, given, Choice.NEAREST).parameters) for learned in maps
    ]
    one = maps[0]
    keys = [axis.key for axis in (*one.axes_of(Role.PARAMETER), *one.axes_of(Role.CONTEXT))]
    values = np.hstack([np.concatenate(parameters), np.tile(one.unscale(Role.CONTEXT, given), (len(maps), 1))])
    points = [dict(zip(keys, row, strict=True)) for row in values.tolist()]
    thrown = [number for number, point in enumerate(points) if world.find_refusal(point) is None]
    places = np.full((len(points), targets.shape[1]), np.nan)
    throws = world.throw_many([points[number] for number in thrown], processes=processes)
    for number, throw in zip(thrown, throws, strict=True):
        if throw.outcome == world.config.task.success:
            places[number] = [throw.row[column] for column in one.targets]
    return list(zip(parameters, np.split(places, len(maps)), strict=True))


def _distances(places: Array, targets: Array) -> Array:
    """Distance of each throw from its target, shape ``(n,)``; infinite where it did not succeed."""
    away = np.sqrt(((places - targets) ** 2).sum(axis=1))
    return np.where(np.isfinite(away), away, np.inf)


def _list_throws(targets: Array, places: Array) -> list[ThrowAtTarget]:
    return [
        ThrowAtTarget(target=target, place=place if np.isfinite(place).all() else None)
        for target, place in zip(targets.tolist(), places.tolist(), strict=True)
    ]
