"""How models hit in closed loop, over several seeds: ``python -m bench.learning MODEL [CONFIG [SCATTER]] [--seeds N]``.

Without CONFIG: throws by the model, by the map that is distilled of it, and by models of random parts of its throws.
With CONFIG: throws in that world, before and after adapting by 1, 3, 5 and 10 throws there. A row for each seed, then
the medians of the rows; distances in centimetres, angles in degrees; all of it in simulation.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from throwcollect import Simulator, load_model
from throwcollect.learning.adapting import adapt
from throwcollect.learning.aiming import aim
from throwcollect.learning.distilling import distil
from throwcollect.learning.fitting import fit_throws
from throwcollect.learning.learned_map import LearnedMap, Role
from throwcollect.learning.scoring import draw_targets
from throwcollect.units import unit_of_name

SCALES = {"m": (100.0, "cm"), "rad": (180.0 / np.pi, "deg")}


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("model", type=Path)
    arguments.add_argument("config", nargs="?", type=Path)
    arguments.add_argument("scatter", nargs="?", type=float, default=0.0)
    arguments.add_argument("--seeds", type=int, default=5)
    arguments.add_argument("--targets", type=int, default=20)
    given = arguments.parse_args()
    model = load_model(given.model)
    rows: dict[str, list[list[float]]] = {}
    with Simulator(given.config or given.model / "config.yaml") as simulator:
        for seed in range(given.seeds):
            if given.config is None:
                found = score_here(model.learned, simulator, given.targets, seed)
            else:
                error = float(np.hypot(given.scatter, model.file.trained_on.error))
                counts = model.file.trained_on.latents_count
                found = score_there(model.learned, simulator, given.targets, seed, given.scatter, error, counts)
            for name, numbers in found.items():
                rows.setdefault(name, []).append(numbers)
                print(f"seed {seed}  {name:14}", *(f"{number:7.2f}" for number in numbers), flush=True)
    units = "; ".join(f"median, 9 of 10 below, largest [{SCALES[unit][1]}]" for unit in list_units(model.learned))
    print(f"{given.targets} targets for each of {given.seeds} seeds, medians of the seeds, in simulation: {units}")
    for name, numbers in rows.items():
        print(f"{name:22}", *(f"{number:7.2f}" for number in np.median(np.array(numbers), axis=0)))
    worst = max(np.array(each)[:, 0].max() for each in rows.values())
    print(f"largest median of a seed: {worst:.2f}")


def score_here(learned: LearnedMap, simulator: Simulator, count: int, seed: int) -> dict[str, list[float]]:
    context = nominal_context(learned)
    targets = draw_targets(learned.carry_over(context), count, seed)
    order = np.random.default_rng((seed, 2)).permutation(len(learned.values))
    found = {}
    for size in (100, 300):
        if size < len(order):
            part = np.sort(order[:size])
            rows = (learned.values[part], learned.outputs[part], learned.efforts[part])
            smaller = fit_throws(learned.kind, learned.axes, learned.targets, *rows).learned
            found[f"{size} throws"] = throw_at(smaller, targets, simulator)[2]
    found[f"{len(order)} throws"] = throw_at(learned, targets, simulator)[2]
    given = np.repeat(context[np.newaxis], count, axis=0)
    found["distilled"] = throw_by(learned, distil(learned).aim(targets, given), targets, simulator)[2]
    return found


def score_there(
    learned: LearnedMap, simulator: Simulator, count: int, seed: int, scatter: float, error: float, latents_count: bool
) -> dict[str, list[float]]:
    context = nominal_context(learned)
    targets = draw_targets(learned.carry_over(context), count, seed)
    tries = draw_targets(learned.carry_over(context), 10, seed + 1000)
    parameters, places, _ = throw_at(learned, tries, simulator)
    landed = np.isfinite(places).all(axis=1)
    noise = scatter * np.random.default_rng((seed, 1)).standard_normal(places.shape)
    thrown, measured = parameters[landed], (places + noise)[landed]
    given = np.repeat(context[np.newaxis], len(thrown), axis=0)
    worlds = {0: learned}
    for number in (1, 3, 5, len(thrown)):
        options = {"scatter": error, "latents_count": latents_count}
        adapted = adapt(learned, thrown[:number], given[:number], measured[:number], **options)
        worlds[number] = learned.correct(adapted.correction)
    reachable = targets[aim(worlds[len(thrown)], targets, np.repeat(context[np.newaxis], count, axis=0)).reachable]
    return {f"after {number}": throw_at(world, reachable, simulator)[2] for number, world in worlds.items()}


def throw_at(learned: LearnedMap, targets: np.ndarray, simulator: Simulator) -> tuple[np.ndarray, np.ndarray, list]:
    given = np.repeat(nominal_context(learned)[np.newaxis], len(targets), axis=0)
    return throw_by(learned, aim(learned, targets, given).parameters, targets, simulator)


def throw_by(
    learned: LearnedMap, parameters: np.ndarray, targets: np.ndarray, simulator: Simulator
) -> tuple[np.ndarray, np.ndarray, list]:
    """Throw; returns scaled parameters, places, and median, ninth decile and largest miss for each unit."""
    keys = [axis.key for axis in (*learned.axes_of(Role.PARAMETER), *learned.axes_of(Role.CONTEXT))]
    given = np.repeat(nominal_context(learned)[np.newaxis], len(targets), axis=0)
    values = np.hstack([learned.unscale(Role.PARAMETER, parameters), learned.unscale(Role.CONTEXT, given)])
    places = np.full(targets.shape, np.nan)
    for number, row in enumerate(values.tolist()):
        point = dict(zip(keys, row, strict=True))
        if simulator.find_refusal(point) is None:
            throw = simulator.throw(point)
            if throw.outcome == simulator.config.task.success:
                places[number] = [throw.row[target] for target in learned.targets]
    numbers: list[float] = []
    for unit in list_units(learned):
        columns = [unit_of_name(target) == unit for target in learned.targets]
        away = np.linalg.norm((places - targets)[:, columns], axis=1) * SCALES[unit][0]
        ordered = np.sort(np.where(np.isfinite(away), away, np.inf))
        numbers += [ordered[(len(ordered) - 1) // 2], ordered[int(np.ceil(0.9 * len(ordered))) - 1], ordered[-1]]
    return parameters, places, numbers


def list_units(learned: LearnedMap) -> list[str]:
    return sorted({unit_of_name(target) for target in learned.targets})


def nominal_context(learned: LearnedMap) -> np.ndarray:
    nominal = np.array([[axis.nominal for axis in learned.axes_of(Role.CONTEXT)]], np.float64)
    return np.clip(learned.scale(Role.CONTEXT, nominal)[0], -1.0, 1.0)


if __name__ == "__main__":
    main()
