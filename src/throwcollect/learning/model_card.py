"""Writes the card of a model: axes, errors, misses, what it was not tested on, and how a robot's program uses it."""

from __future__ import annotations

from collections.abc import Sequence

from throwcollect.learning.adapting import Adaptation, Method
from throwcollect.learning.learned_map import Axis
from throwcollect.learning.model_file import ModelFile
from throwcollect.learning.score import SCORE_HEAD, Score, format_length, format_scatter
from throwcollect.wording import format_count

PROGRAM = """\
import json
import numpy as np

model = json.load(open("model.json"))
axes, correction = model["axes"], model["correction"]
powers, factors = np.array(model["forward"]["exponents"]), np.array(model["forward"]["coefficients"])
chosen = np.array([axis["role"] == "parameter" for axis in axes])
low, high = (np.array([axis[end] for axis in axes]) for end in ("minimum", "maximum"))
x = np.where(chosen, 0.0, (np.array([axis["nominal"] for axis in axes]) - low) / (high - low) * 2 - 1)
x[[axis["role"] == "latent" for axis in axes]] = correction["latents"]
bias = np.zeros(len(axes))
bias[chosen] = correction["bias"]
land = lambda x: np.prod((x + bias) ** powers, axis=1) @ factors + correction["offset"]
for _ in range(50):  # Gauss-Newton steps, inside of the ranges
    slopes = np.array([(land(x + step) - land(x - step)) / 2e-4 for step in 1e-4 * np.eye(len(x))]) * chosen[:, None]
    step = np.linalg.pinv(slopes.T, rcond=1e-3) @ (target - land(x))
    x = np.where(chosen, np.clip(x + step, -1, 1), x)
values = low + (x + 1) / 2 * (high - low)
parameters = {axis["key"]: value for axis, value in zip(axes, values) if axis["role"] == "parameter"}
"""
"""Finds parameters for ``target`` with ``model.json`` alone; the card shows it, and a test runs it."""


ONNX_PROGRAM = """\
import json
import onnxruntime

keys = [axis["key"] for axis in json.load(open("model.json"))["axes"] if axis["role"] == "parameter"]
session = onnxruntime.InferenceSession("model.onnx")
parameters = dict(zip(keys, session.run(None, {"target": [target]})[0][0].tolist()))
"""
"""Does the same with ``model.onnx``."""


def describe_model(file: ModelFile, score: Score | None) -> str:
    """README.md of a model; its score is None if nobody has thrown with it."""
    trained = file.trained_on
    lines = [
        f"# A model of {trained.name}",
        "",
        f"It maps the parameters of a trial to where it ends ({', '.join(file.targets)}), and back: from a target to "
        f"parameters. Learned from {format_count(trained.throws, 'throw')} of the dataset with the digest "
        f"`{trained.digest}`" + (f" (those with `{trained.selection}`)" if trained.selection else "") + "; "
        f"{trained.ignored} that did not succeed were left out. Robot: {trained.robot}; task: {trained.task}; physics "
        f"engine: {trained.engine}. Made with throwcollect {file.version}.",
        "",
        "| key | it is | from | to | configured | unit |",
        "|---|---|---|---|---|---|",
        *map(_describe_axis, file.axes),
        "",
        "Parameters are chosen when aiming, context is given with the target, latents belong to the world. Nothing is "
        "extrapolated beyond the ranges.",
        "",
        f"Predictions for throws that polynomials were not fitted to are off by {_format_length(trained.error, file)} "
        "(median, in simulation); by degree: "
        + ", ".join(f"{degree}: {_format_length(error, file)}" for degree, error in trained.folds_error.items())
        + (
            f"; without latents: {_format_length(trained.without_latents, file)}"
            if trained.without_latents is not None
            else ""
        )
        + ".",
        "",
    ]
    if file.adaptation is not None:
        lines += _describe_adaptation(file.adaptation, file)
    if score is not None:
        lines += _describe_score(score, file)
    return "\n".join([*lines, *_describe_use(file)])


def _describe_use(file: ModelFile) -> list[str]:
    lines = [
        "## What it was not tested on",
        "",
        "A real robot; balls, tools, surfaces and postures other than the dataset's; throws that scatter. Every number "
        "on this page is one in simulation.",
        "",
        "## In a program of a robot",
        "",
        "`model.json` alone is enough. For a `target`, in the order and the units above:",
        "",
        "```python",
        PROGRAM.rstrip(),
        "```",
        "",
    ]
    if file.distilled is not None:
        lines += [
            "`model.onnx` needs no NumPy in a controller: one polynomial, distilled from this model. Its parameters "
            "stay inside of their ranges for any target, in reach or not. In Python:",
            "",
            "```python",
            ONNX_PROGRAM.rstrip(),
            "```",
            "",
        ]
    return lines


def _describe_axis(axis: Axis) -> str:
    unit = axis.unit or "-"
    return (
        f"| `{axis.key}` | {axis.role.value} | {axis.minimum:.6g} | {axis.maximum:.6g} | {axis.nominal:.6g} | {unit} |"
    )


def _describe_adaptation(adaptation: Adaptation, file: ModelFile) -> list[str]:
    throws = format_count(adaptation.throws, "throw")
    if adaptation.method is Method.NONE:
        return ["## Adapted to another world", "", f"{throws} there did not speak for any difference.", ""]
    lines = [
        "## Adapted to another world",
        "",
        f"By {throws} there; what differs was taken to be: {adaptation.method.value}.",
        "",
        "| | found | standard deviation |",
        "|---|---|---|",
        *(f"| `{each.name}` | {each.value:.4g} | {each.deviation:.2g} |" for each in adaptation.found),
        "",
    ]
    before, after = adaptation.medians
    if after is not None:
        lines += [
            f"The throws were off by {_format_length(before, file)} before (median), "
            f"and by {_format_length(after, file)} after, each predicted by a model that was adapted to the others.",
            "",
        ]
    return lines


def _describe_score(score: Score, file: ModelFile) -> list[str]:
    targets = format_count(score.targets, "target")
    rows = score.list_rows()
    here = len(rows) - len(score.adapted)
    lines = [
        "## How it hits",
        "",
        f"Misses of {targets} for each of {format_count(score.seeds, 'seed')} (from {score.seed} on), medians of "
        "the seeds; each draws targets, the throws that were learned from, and those in another world; in simulation:",
        "",
        *_tabulate(rows[:here]),
        "",
    ]
    if score.adapted:
        scatter = (
            f", with a scatter of {format_scatter(score.scatter, file.targets)} of what is measured"
            if score.scatter
            else ""
        )
        lines += [
            f"In another world{scatter}, at those of these targets that can be reached there, in simulation:",
            "",
            *_tabulate(rows[here:]),
            "",
        ]
    return lines


def _tabulate(rows: Sequence[tuple[str, ...]]) -> list[str]:
    lines = [("", *SCORE_HEAD), ("---",) * (len(SCORE_HEAD) + 1), *rows]
    return [f"| {' | '.join(cells)} |" for cells in lines]


def _format_length(value: float | None, file: ModelFile) -> str:
    """A distance between targets, over all of them."""
    return format_length(value, file.targets)
