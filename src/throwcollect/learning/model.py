"""A model finds parameters of a throw for a target; it is learned from a dataset, and can be scored and adapted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
import pyarrow as pa
from pydantic import Field, ValidationError

from throwcollect.config.task_config import LARGEST_TARGET
from throwcollect.dataset.carried_robot import copy_carried
from throwcollect.dataset.directory import is_begun
from throwcollect.errors import ConfigError, DatasetError, read_word, refuse_argument
from throwcollect.extras import require
from throwcollect.files import StrPath, new_directory, read_text, suggest_path, write_file
from throwcollect.learning.adapting import Method, adapt, refuse_far_throws
from throwcollect.learning.aiming import Aim, Choice, aim
from throwcollect.learning.distilling import ONNX, distil, encode_onnx
from throwcollect.learning.learned_map import EFFORT, KeyRole
from throwcollect.learning.model_card import ModelCard
from throwcollect.learning.polynomial import Array, ModelEntry
from throwcollect.learning.score import Score
from throwcollect.learning.scoring import Simulates, score_model
from throwcollect.plan.parquet_file import encode_table, read_parquet
from throwcollect.version import __version__
from throwcollect.wording import command, format_count

MODEL = "model.json"
POINTS = "points.parquet"
CONFIG = "config.yaml"
SCORE = "score.json"
CARD = "README.md"
_MOST_BYTES = 100_000_000

_File = TypeVar("_File", bound=ModelEntry)


class Model(ModelCard):
    """Where throws with given parameters end, and which parameters lead to a target.

    A model is a pure function of the dataset and of the arguments of `fit`, `adapt` and `distil`, byte for byte.

    Its other attributes are those of `ModelCard` and `LearnedMap`.

    Attributes:
        config: YAML of the dataset's configuration; a file of its own.
        source: Directory with the files that the configuration names, of the dataset or of a model; they are copied.
    """

    config: str = Field(default="", exclude=True)
    source: Path | None = Field(default=None, exclude=True)

    def __repr__(self) -> str:
        trained = self.trained_on
        learned = f"{trained.name!r}, {format_count(trained.throws, 'throw')}"
        return f"Model({learned}: {', '.join((*self.targets, *self.given))} -> {', '.join(self.parameters)})"

    @property
    def parameters(self) -> tuple[str, ...]:
        """Keys that aiming chooses."""
        return tuple(axis.key for axis in self.axes_of(KeyRole.PARAMETER))

    @property
    def given(self) -> tuple[str, ...]:
        """Keys whose values are given after a target's."""
        return tuple(axis.key for axis in self.axes_of(KeyRole.CONTEXT))

    @property
    def latents(self) -> tuple[str, ...]:
        """Keys of the world, whose values are only known from throws."""
        return tuple(axis.key for axis in self.axes_of(KeyRole.LATENT))

    def predict(self, points: Sequence[Mapping[str, float]]) -> Array:
        """Where throws should end, in the units of the targets, shape ``(n_points, n_targets)``.

        Args:
            points: For each throw, values by key of all `parameters` and all `given`.

        Raises:
            ConfigError: If a key is missing or unknown.
        """
        parameters, context = self._read_inputs(points)
        return self.predict_ends(parameters, context)

    def aim(self, targets: Iterable[Sequence[float]], *, choose: str = Choice.NEAREST.value) -> list[Aim]:
        """Find parameters for targets, inside of the ranges of the dataset.

        Args:
            targets: Values of `targets` and then of `given` for each, such as ``[(1.4, -0.2)]``.
            choose: Which of several parameters are taken: ``nearest`` or ``least-effort``.

        Raises:
            ConfigError: If a target has another number of values, is no number or beyond 1e6, or the choice is unknown.
        """
        names = (*self.targets, *self.given)
        rows = _read_places("targets", targets, names)
        ends, values = rows[:, : len(self.targets)], rows[:, len(self.targets) :]
        context = self.scale(KeyRole.CONTEXT, values)
        found = aim(self, ends, context, read_word("choose", choose, Choice))
        chosen = self.unscale(KeyRole.PARAMETER, found.parameters)
        inside = np.all(np.abs(context) <= 1.0, axis=1).tolist()
        return [
            Aim(
                row,
                dict(zip((*self.parameters, *self.given), (*chosen[n].tolist(), *values[n].tolist()), strict=True)),
                found.predicted[n],
                bool(found.reachable[n]) and inside[n],
                found.nearest_place[n],
            )
            for n, row in enumerate(rows)
        ]

    def score(
        self,
        simulator: Simulates,
        *,
        targets: int = 40,
        seed: int = 0,
        seeds: int = 3,
        world: Simulates | None = None,
        scatter: float = 0.0,
        processes: int = 1,
    ) -> Score:
        """Throw at targets in simulation, and measure by how much they are missed.

        If the model was distilled, the distilled map throws at them, too.

        Args:
            simulator: Simulates the world of the dataset.
            targets: Number of targets of each seed.
            seed: The first seed for choosing targets; models of one dataset get the same targets.
            seeds: Number of seeds, whose medians are taken.
            world: Simulates another world, in which the model is adapted by a few throws; None for none.
            scatter: Standard deviation of noise on the measured ends of those throws, in the unit of the targets.
            processes: How many processes simulate.

        Raises:
            WorkerError: If a process of a simulator ends.
        """
        distilled = None if self.distilled is None else distil(self.correct(None))
        return score_model(
            self,
            simulator,
            count=targets,
            seeds=range(seed, seed + seeds),
            world=world,
            scatter=scatter,
            distilled=distilled,
            processes=processes,
        )

    def adapt(
        self,
        points: Sequence[Mapping[str, float]],
        places: Sequence[Sequence[float]],
        *,
        method: str | None = None,
        scatter: float = 0.0,
    ) -> Model:
        """Make the model of another world from a few throws there; it is distilled if this model was.

        Args:
            points: For each throw, values by key of all `parameters` and all `given`.
            places: Where these throws ended, each as many numbers as `targets`.
            method: How the world may differ: ``offset``, ``bias``, ``latent`` or ``none``; None to choose.
            scatter: Standard deviation of the measured ends, in the unit of the targets.

        Raises:
            ConfigError: If there are no throws, or not one place for each; a key is missing or unknown, there is no
                such method, or a parameter, context or place is far outside the dataset.
        """
        parameters, context = self._read_inputs(points)
        measured = _read_places("places", places, self.targets)
        if not len(measured) or len(measured) != len(parameters):
            raise ConfigError(
                f"{len(parameters)} throws and {len(measured)} places", expected="one place for each throw"
            )
        chosen = None if method is None else read_word("method", method, Method)
        if chosen is Method.LATENT and not self.latents:
            raise refuse_argument(
                "method",
                "'latent': the dataset has no latents",
                expected="a dataset whose sweep varies the world",
                hint="try bias",
            )
        refuse_far_throws(self, parameters, context, measured)
        correction, adaptation = adapt(self, parameters, context, measured, method=chosen, scatter=scatter)
        changed = {"adaptation": adaptation, "version": __version__, "distilled": None}
        world = self.correct(correction).model_copy(update=changed)
        return world if self.distilled is None else world.distil()

    def distil(self) -> Model:
        """Add one polynomial from targets to parameters, which `save` writes into ``model.onnx``, too.

        Raises:
            MissingExtraError: If the package ``onnx`` is not installed.
        """
        require("onnx")
        return self.model_copy(update={"distilled": distil(self)})

    def save(self, directory: StrPath) -> None:
        """Write the model into a directory that is new or empty.

        Raises:
            ConfigError: If the directory is not empty.
            DatasetError: If it cannot be written.
            MissingExtraError: If the model was distilled, and the package ``onnx`` is not installed.
        """
        onnx = None if self.distilled is None else encode_onnx(self, self.distilled)
        with new_directory(Path(directory)) as scratch:
            write_file(scratch / MODEL, (self.model_dump_json(indent=1) + "\n").encode())
            write_file(scratch / POINTS, encode_table(pa.table(dict(self._columns()))))
            write_file(scratch / CONFIG, self.config.encode())
            write_file(scratch / CARD, self.describe(None).encode())
            if self.source is not None:
                copy_carried(self.source, scratch)
            if onnx is not None:
                write_file(scratch / ONNX, onnx)

    def write_score(self, directory: Path, score: Score) -> None:
        """Write a score into the directory of this model, in place of an earlier one, and into the model's card."""
        write_file(directory / SCORE, (score.model_dump_json(indent=1) + "\n").encode())
        write_file(directory / CARD, self.describe(score).encode())

    def _columns(self) -> Iterator[tuple[str, Array]]:
        """The throws that it was learned from, as columns of their file."""
        yield from zip((axis.key for axis in self.axes), self.values.T, strict=True)
        yield from zip(self.targets, self.outputs.T, strict=True)
        yield EFFORT, self.efforts

    def _read_inputs(self, points: Sequence[Mapping[str, float]]) -> tuple[Array, Array]:
        """Read scaled parameters and context of points."""
        names = (*self.parameters, *self.given)
        for number, point in enumerate(points):
            if wrong := sorted(set(point) ^ set(names), key=str):
                raise ConfigError(f"throw {number}: {', '.join(wrong)}", expected=f"values of {', '.join(names)}")
        values = np.array([[point[name] for name in names] for point in points], np.float64).reshape(-1, len(names))
        parameters, context = np.split(values, [len(self.parameters)], axis=1)
        return self.scale(KeyRole.PARAMETER, parameters), self.scale(KeyRole.CONTEXT, context)


def load_model(directory: StrPath) -> Model:
    """Read a model from its directory.

    Raises:
        DatasetError: If there is none, or it is damaged.
    """
    directory = Path(directory)
    path = directory / MODEL
    try:
        text = read_text(path, most_bytes=_MOST_BYTES)
    except DatasetError as error:
        if not isinstance(error.__cause__, FileNotFoundError):
            raise
        # Users easily give a dataset in place of its model, so the hint makes a model of it.
        dataset = directory if is_begun(directory) else "DATASET"
        hint = command("fit", dataset, "-o", "MODEL")
        problem = f"holds no model: there is no {MODEL}{suggest_path(directory)}"
        raise DatasetError(problem, path=directory, hint=hint) from error
    model = _read_json(Model, text, path)
    points = read_parquet(directory / POINTS)
    keys = [axis.key for axis in model.axes]
    if missing := {*keys, *model.targets, EFFORT}.difference(points.column_names):
        raise DatasetError("does not have the columns of this model", path=directory / POINTS, expected=min(missing))
    values, outputs = (np.column_stack([points[name].to_numpy() for name in names]) for names in (keys, model.targets))
    config = read_text(directory / CONFIG, most_bytes=_MOST_BYTES)
    model = model.begin_from(values, outputs, points[EFFORT].to_numpy())
    return model.model_copy(update={"config": config, "source": directory})


def read_score(directory: Path) -> Score | None:
    """Read the score of a model from its directory; None if it has none."""
    path = directory / SCORE
    return _read_json(Score, read_text(path, most_bytes=_MOST_BYTES), path) if path.exists() else None


def _read_json(kind: type[_File], text: str, path: Path) -> _File:
    try:
        return kind.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise DatasetError(
            f"{where + ': ' if where else ''}{first['msg']}", path=path, hint="throwcollect fit makes models"
        ) from error


def _read_places(argument: str, given: Iterable[Sequence[float]], names: Sequence[str]) -> Array:
    """Read targets, or places where throws ended, shape ``(n, n_names)``."""
    rows = [list(map(float, place)) for place in given]
    for row in rows:
        if len(row) != len(names) or not (np.abs(row) <= LARGEST_TARGET).all():
            wanted = f"finite numbers of at most {LARGEST_TARGET:g}: {', '.join(names)}"
            raise refuse_argument(argument, f"got {row}", expected=wanted)
    return np.array(rows, np.float64).reshape(-1, len(names))
