"""Arithmetic that does not depend on the processor."""

import hashlib
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from tests import processors
from tests.unit.plan.own_plan import make_plan

from throwcollect.config.loader import load
from throwcollect.episode.frames import Frame
from throwcollect.reproducible_math import add_up, cos, exp, matmul, power, sin, solve
from throwcollect.robots.trajectory import sample_quintic
from throwcollect.tasks.task import task_of

ROOT = Path(__file__).parents[2]

CONFIGS = ("dmp", "grid", "motions", "quickstart", "randomised", "reference", "wide")
"""All samplers, scales and families of motions; other configurations compute by the same functions."""
PRINTED = """
from tests.unit.test_reproducible_math import compute

print(*compute(), sep="\\n")
"""


def show(name: str, *arrays: object) -> str:
    """A line with the hash of each array."""
    hashes = (hashlib.sha256(np.array(array, np.float64).tobytes()).hexdigest()[:16] for array in arrays)
    return " ".join((name, *hashes))


def compute() -> Iterator[str]:
    """Hashes of all arrays that are computed before a simulation gets them."""
    for name in CONFIGS:
        path = ROOT / "configs" / f"{name}.yaml"
        plan = make_plan(load(path), directory=path.parent)
        yield show(path.name, *([*trial.values.values()] for trial in plan.trials[:50]))
        for trial in plan.trials[:5]:
            trajectory = task_of(plan.config_of(trial)).trajectory()
            sent = (trajectory.times, trajectory.positions, trajectory.velocities, trajectory.accelerations)
            yield show("sent", *sent)
            yield show("desired", *sample_quintic(trajectory, np.linspace(0, 2, 500)))
    frame = Frame("a", "b", (0.0, 0.0, 0.0), (0.0, 0.6, 0.0, 0.8), "j", (0.36, 0.48, 0.8))
    yield show("frame", frame.rotation_at(np.linspace(-7, 7, 5000)))


def compute_on_another_processor() -> list[str]:
    whole = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}:{ROOT}", **processors.PLAIN}
    script = [sys.executable, "-c", PRINTED]
    done = subprocess.run(script, cwd=ROOT, env=whole, capture_output=True, text=True, timeout=120, check=True)
    return done.stdout.splitlines()


def test_plans_and_motions_are_the_same_on_another_processor() -> None:
    here = list(compute())
    assert len(here) > 70
    assert here == compute_on_another_processor()


@pytest.mark.parametrize(
    ("ours", "numpys", "values"),
    [
        (exp, np.exp, np.linspace(-700, 700, 999)),
        (sin, np.sin, np.linspace(-20, 20, 999)),
        (cos, np.cos, np.linspace(-20, 20, 999)),
        (lambda bases: power(bases, 1.7), lambda bases: bases**1.7, np.linspace(0, 50, 999)),
    ],
)
def test_functions_equal_those_of_numpy_up_to_rounding(
    ours: Callable[..., NDArray[np.float64]], numpys: Callable[..., NDArray[np.float64]], values: NDArray[np.float64]
) -> None:
    np.testing.assert_allclose(ours(values), numpys(values), rtol=1e-15, atol=1e-15)
    grid = values.reshape(27, 37)[::2].T
    np.testing.assert_array_equal(ours(grid), ours(grid.ravel()).reshape(grid.shape))
    assert ours(values[:0]).shape == (0,)


def test_power_accepts_zero_as_base() -> None:
    np.testing.assert_array_equal(power(np.array([0.0, 1.0]), 0.0), [1.0, 1.0])
    np.testing.assert_array_equal(power(np.array([0.0, 2.0]), 3.0), [0.0, 8.0])


def test_matmul_broadcasts_stacks_of_matrices() -> None:
    randomness = np.random.default_rng(0)
    left, right = randomness.random((2, 3)), randomness.random((7, 3, 4))
    np.testing.assert_allclose(matmul(left, right), left @ right, rtol=1e-14)
    np.testing.assert_array_equal(matmul(left, right[2]), matmul(left, right)[2])
    assert matmul(left, right[:0]).shape == (0, 2, 4)


def test_solve_solves_symmetric_positive_definite_systems() -> None:
    randomness = np.random.default_rng(0)
    roots = randomness.standard_normal((9, 4, 6))
    matrices, right = roots @ roots.swapaxes(1, 2), randomness.standard_normal((9, 4, 2))
    kept = matrices.copy()
    np.testing.assert_allclose(matrices @ solve(matrices, right), right, atol=1e-10)
    np.testing.assert_array_equal(matrices, kept)
    tiny = np.full((1, 1), 1e-300)
    assert math.isclose(solve(tiny, np.ones((1, 1))).item(), 1e300)


def test_add_up_gives_the_same_sum_on_every_python() -> None:
    # `sum` returns 1.0 from Python 3.12 on.
    assert add_up([0.1] * 10) == 0.9999999999999999
    assert add_up(iter(())) == 0.0
