"""What is in ``model.json``, and the card of a model: axes, errors, misses, and how a robot's program uses it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

from throwcollect.learning.adapting import Adaptation
from throwcollect.learning.distilling import DistilledMap
from throwcollect.learning.learned_map import LearnedMap
from throwcollect.learning.polynomial import ModelEntry
from throwcollect.learning.score import SCORE_HEAD, Score, format_length, list_units
from throwcollect.units import format_distance
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


class TrainedOn(ModelEntry):
    """The dataset and the throws that the model was learned from.

    Attributes:
        name: Name of the collection.
        robot: Name of the robot.
        task: Name of the task.
        engine: Name of the physics engine.
        digest: Digest of the dataset.
        throws: Number of throws that it was learned from.
        ignored: Number of throws that did not succeed.
    """

    name: str
    robot: str
    task: str
    engine: str
    digest: str
    throws: int
    ignored: int


class ModelCard(LearnedMap):
    """A learned map, and where it comes from: ``model.json``; `describe` makes its card.

    Attributes:
        version: Version of throwcollect that made it.
        trained_on: The throws that it was learned from.
        adaptation: How it was adapted; None if it was not.
        distilled: A polynomial from targets to parameters; None if it was not distilled.
    """

    format: Literal["1"] = "1"
    version: str
    trained_on: TrainedOn
    adaptation: Adaptation | None = None
    distilled: DistilledMap | None = None

    def describe(self, score: Score | None) -> str:
        """README.md of the model; its score is None if it has none."""
        trained, targets = self.trained_on, self.targets
        folds = ", ".join(f"{degree}: {format_length(error, targets)}" for degree, error in self.errors.items())
        if self.blind_error is not None:
            folds += f"; without latents: {format_length(self.blind_error, targets)}"
        axes = []
        for axis in self.axes:
            numbers = (f"{number:.6g}" for number in (axis.minimum, axis.maximum, axis.nominal))
            axes.append((f"`{axis.key}`", axis.role.value, *numbers, axis.unit or "-"))
        blocks = [
            f"# A model of {trained.name}",
            f"It maps the parameters of a trial to where it ends ({', '.join(targets)}), and back: from a target to "
            f"parameters. Learned from {format_count(trained.throws, 'throw')} of the dataset with the digest "
            f"`{trained.digest}`; {trained.ignored} that did not succeed were left out. Robot: "
            f"{trained.robot}; task: {trained.task}; physics engine: {trained.engine}. Made with "
            f"throwcollect {self.version}.",
            _tabulate(("key", "it is", "from", "to", "configured", "unit"), axes),
            "Parameters are chosen when aiming, context is given with the target, latents belong to the world. Nothing "
            "is extrapolated beyond the ranges.",
            "Predictions for throws that polynomials were not fitted to are off by "
            f"{format_length(self.error, targets)} (median, in simulation); by degree: {folds}.",
        ]
        if self.adaptation is not None:
            blocks += _describe_adaptation(self.adaptation, targets)
        if score is not None:
            blocks += _describe_score(score, targets)
        blocks += [
            "## What it was not tested on",
            "A real robot; balls, tools, surfaces and postures other than the dataset's; throws that scatter. Every "
            "number on this page is one in simulation.",
            "## In a program of a robot",
            "`model.json` alone is enough. For a `target`, in the order and the units above:",
            f"```python\n{PROGRAM}```",
        ]
        if self.distilled is not None:
            blocks += [
                "`model.onnx` needs no NumPy in a controller: one polynomial, distilled from this model. Its "
                "parameters stay inside of their ranges for any target, in reach or not. In Python:",
                f"```python\n{ONNX_PROGRAM}```",
            ]
        return "\n\n".join(blocks) + "\n"


def _describe_adaptation(adaptation: Adaptation, targets: Sequence[str]) -> Iterator[str]:
    throws = format_count(adaptation.throws, "throw")
    yield "## Adapted to another world"
    yield f"By {throws} there; what differs was taken to be: {adaptation.method.value}."
    found = [(f"`{each.name}`", f"{each.value:.4g}", f"{each.deviation:.2g}") for each in adaptation.found]
    yield _tabulate(("", "found", "standard deviation"), found)
    before, after = adaptation.medians
    if after is not None:
        yield (
            f"The throws were off by {format_length(before, targets)} before (median), and by "
            f"{format_length(after, targets)} after, each predicted by a model that was adapted to the others."
        )


def _describe_score(score: Score, targets: Sequence[str]) -> Iterator[str]:
    yield "## How it hits"
    text = (
        f"Misses of {format_count(score.targets, 'target')} for each of {format_count(score.seeds, 'seed')} (from "
        f"{score.seed} on), medians of the seeds, in simulation; in another world of those that can be reached there"
    )
    if score.scatter:
        scatter = " and ".join(format_distance(score.scatter, unit) for unit in list_units(targets))
        text += f", with a scatter of {scatter} of what is measured"
    yield f"{text}."
    yield _tabulate(("", *SCORE_HEAD), score.list_rows())


def _tabulate(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Make a table in Markdown."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows))
