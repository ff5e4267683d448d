"""A model finds parameters of a throw for a target; it is learned from a dataset, and can be scored and adapted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from throwcollect.arguments import check_bounds, read_word, refuse_argument
from throwcollect.config.loader import dump_yaml
from throwcollect.config.task_config import LARGEST_TARGET
from throwcollect.errors import ConfigError
from throwcollect.extras import require
from throwcollect.files import StrPath
from throwcollect.learning.adapting import Method, adapt, refuse_far_inputs, refuse_far_places
from throwcollect.learning.aiming import Aim, Choice, aim
from throwcollect.learning.arrays import Array
from throwcollect.learning.distilling import distil
from throwcollect.learning.fitting import Fit, fit_map
from throwcollect.learning.learned_map import KeyRole, Kind, LearnedMap
from throwcollect.learning.model_directory import read_model, write_model
from throwcollect.learning.model_file import AdaptationEntry, ModelFile, TrainedOn, list_found
from throwcollect.learning.score import Score, pool_scores
from throwcollect.learning.scoring import Simulates, leave_out_correction, score_model
from throwcollect.version import __version__
from throwcollect.wording import format_count

if TYPE_CHECKING:
    from throwcollect.dataset.reader import Dataset


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """Where throws with given parameters end, and which parameters lead to a target.

    A model is a pure function of the dataset and of the arguments of `fit`, byte for byte.

    Attributes:
        file: The model without the throws that it was learned from.
        learned: The map, with these throws.
        trials: Numbers of their trials, shape ``(n,)``.
        config: YAML of the dataset's configuration.
    """

    file: ModelFile
    learned: LearnedMap
    trials: NDArray[np.int64]
    config: str

    def __repr__(self) -> str:
        trained = self.file.trained_on
        learned = f"{trained.name!r}, {self.learned.kind.value}, {format_count(trained.throws, 'throw')}"
        return f"Model({learned}: {', '.join((*self.targets, *self.given))} -> {', '.join(self.parameters)})"

    @property
    def parameters(self) -> tuple[str, ...]:
        """Keys that aiming chooses."""
        return tuple(axis.key for axis in self.learned.axes_of(KeyRole.PARAMETER))

    @property
    def given(self) -> tuple[str, ...]:
        """Keys whose values are given after a target's."""
        return tuple(axis.key for axis in self.learned.axes_of(KeyRole.CONTEXT))

    @property
    def latents(self) -> tuple[str, ...]:
        """Keys of the world, whose values are only known from throws."""
        return tuple(axis.key for axis in self.learned.axes_of(KeyRole.LATENT))

    @property
    def targets(self) -> tuple[str, ...]:
        """Columns of the table of throws that say where a trial ended."""
        return self.learned.targets

    def predict(self, points: Sequence[Mapping[str, float]]) -> Array:
        """Where throws should end, in the units of the targets, shape ``(n_points, n_targets)``.

        Args:
            points: For each throw, values by key of all `parameters` and all `given`.

        Raises:
            ConfigError: If a key is missing or unknown, or a value is not finite.
        """
        parameters, context = self._read_inputs(points)
        return self.learned.predict(parameters, context)

    def aim(self, targets: Iterable[Sequence[float]], *, choose: str = Choice.NEAREST.value) -> list[Aim]:
        """Find parameters for targets, inside of the ranges of the dataset.

        Args:
            targets: Values of `targets` and then of `given` for each, such as ``[(1.4, -0.2)]``.
            choose: Which of several parameters are taken: ``nearest``, ``least-effort`` or ``least-sensitive``.

        Raises:
            ConfigError: If a target has another number of values, is no number or beyond 1e6, or the choice is unknown.
        """
        names = (*self.targets, *self.given)
        rows = _read_places("targets", targets, names)
        ends, values = rows[:, : len(self.targets)], rows[:, len(self.targets) :]
        context = self.learned.scale(KeyRole.CONTEXT, values)
        found = aim(self.learned, ends, context, read_word("choose", choose, Choice))
        chosen = self.learned.unscale(KeyRole.PARAMETER, found.parameters)
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
            ConfigError: If a number is out of its range.
            WorkerError: If a process of a simulator ends.
        """
        for name, number in (("targets", targets), ("seeds", seeds), ("processes", processes)):
            check_bounds(name, number, least=1)
        check_bounds("seed", seed, least=0)
        _check_scatter(scatter)
        distilled = None if self.file.distilled is None else distil(leave_out_correction(self.learned))
        scores = [
            score_model(
                self.learned,
                simulator,
                count=targets,
                seed=each,
                world=world,
                scatter=scatter,
                error=self.file.trained_on.error,
                latents_count=self.file.trained_on.latents_count,
                distilled=distilled,
                processes=processes,
            )
            for each in range(seed, seed + seeds)
        ]
        return pool_scores(scores)

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
            ConfigError: If there are no throws, or not one place for each; a key is missing or unknown, a value is not
                finite, there is no such method, or a parameter, context or place is far outside the dataset.
        """
        parameters, context = self._read_inputs(points)
        measured = _read_places("places", places, self.targets)
        if not len(measured) or len(measured) != len(parameters):
            raise ConfigError(
                f"{len(parameters)} throws and {len(measured)} places", expected="one place for each throw"
            )
        _check_scatter(scatter)
        chosen = None if method is None else read_word("method", method, Method)
        if chosen is Method.LATENT and not self.latents:
            raise refuse_argument(
                "method",
                "'latent': the dataset has no latents",
                expected="a dataset whose sweep varies the world",
                hint="try bias",
            )
        refuse_far_inputs(self.learned, KeyRole.PARAMETER, parameters)
        refuse_far_inputs(self.learned, KeyRole.CONTEXT, context)
        refuse_far_places(self.learned, measured)
        # A measured place differs from its prediction by the scatter of the throw, and by the error of the model.
        deviation = float(np.hypot(scatter, self.file.trained_on.error))
        adapted = adapt(
            self.learned,
            parameters,
            context,
            measured,
            method=chosen,
            scatter=deviation,
            latents_count=self.file.trained_on.latents_count,
        )
        learned = self.learned.correct(adapted.correction)
        entry = AdaptationEntry(
            method=adapted.method,
            throws=len(measured),
            scatter=deviation,
            before=adapted.before.tolist(),
            after=adapted.after.tolist(),
            found=list_found(learned, adapted.method, adapted.deviations),
        )
        file = self.file.model_copy(
            update={"correction": adapted.correction, "adaptation": entry, "version": __version__, "distilled": None}
        )
        world = replace(self, file=file, learned=learned)
        return world if self.file.distilled is None else world.distil()

    def distil(self) -> Model:
        """Add one polynomial from targets to parameters, which `save` writes into ``model.onnx``, too.

        Raises:
            MissingExtraError: If the package ``onnx`` is not installed.
        """
        require("onnx")
        return replace(self, file=self.file.model_copy(update={"distilled": distil(self.learned)}))

    def save(self, directory: StrPath) -> None:
        """Write the model into a directory that is new or empty.

        Raises:
            ConfigError: If the directory is not empty.
            DatasetError: If it cannot be written.
            MissingExtraError: If the model was distilled, and the package ``onnx`` is not installed.
        """
        write_model(Path(directory), self.file, self.learned, self.trials, self.config)

    def _read_inputs(self, points: Sequence[Mapping[str, float]]) -> tuple[Array, Array]:
        """Read scaled parameters and context of points."""
        names = (*self.parameters, *self.given)
        rows = []
        for number, point in enumerate(points):
            if wrong := sorted(set(point) ^ set(names), key=str):
                state = "is missing" if wrong[0] in names else "is no key of this model"
                if wrong[0] in (axis.key for axis in self.learned.axes_of(KeyRole.LATENT)):
                    state = "is a property of the world, which the model has learned; leave it out"
                raise ConfigError(f"throw {number}: {wrong[0]} {state}", expected=f"values of {', '.join(names)}")
            rows.append([point[name] for name in names])
        values = np.array(rows, np.float64).reshape(-1, len(names))
        if not np.isfinite(values).all():
            number, column = (int(each[0]) for each in np.nonzero(~np.isfinite(values)))
            value = values[number, column]
            raise ConfigError(f"throw {number}: {names[column]} is {value}", expected="a finite number")
        split = len(self.parameters)
        parameters = self.learned.scale(KeyRole.PARAMETER, values[:, :split])
        return parameters, self.learned.scale(KeyRole.CONTEXT, values[:, split:])


def fit(
    dataset: Dataset | StrPath,
    *,
    kind: str = Kind.LOCAL.value,
    targets: Sequence[str] = (),
    parameters: Sequence[str] = (),
    given: Sequence[str] = (),
    where: str | None = None,
) -> Model:
    """Learn a model from the throws of a dataset that succeeded.

    Args:
        dataset: The dataset, or its directory.
        kind: ``local``: predict by a polynomial, corrected by the nearest throws; or ``polynomial``: by the polynomial
            alone.
        targets: Columns that say where a trial ended; those of the task by default.
        parameters: Swept keys that aiming chooses; all of the task by default. The others belong to the world.
        given: Swept keys whose values are given with a target; those that the task names by default.
        where: A condition on throws, as `Dataset.select` takes it.

    Raises:
        ConfigError: If there is no such kind, nothing to aim at, a key was not swept, no throw fulfils the condition,
            or too few throws succeeded.
        DatasetError: If the directory holds no finished dataset, or the dataset is damaged.
    """
    from throwcollect.dataset.reader import Dataset
    from throwcollect.dataset.selection import find_rows

    chosen = read_word("kind", kind, Kind)
    if not isinstance(dataset, Dataset):
        dataset = Dataset.open(dataset)
    throws = dataset
    if where is not None:
        throws = dataset.select(find_rows(where, dataset.throws, "where"))
        if not len(throws):
            raise refuse_argument("where", f"no {dataset.config.task.noun} of {dataset.directory} fulfils {where!r}")
    found = fit_map(throws, kind=chosen, targets=tuple(targets), parameters=tuple(parameters), context=tuple(given))
    return Model(_describe(found, dataset, where), found.learned, found.trials, dump_yaml(dataset.config))


def load_model(directory: StrPath) -> Model:
    """Read a model from its directory.

    Raises:
        DatasetError: If there is none, or it is damaged.
    """
    return Model(*read_model(Path(directory)))


def _describe(found: Fit, dataset: Dataset, where: str | None) -> ModelFile:
    learned, validation = found.learned, found.validation
    return ModelFile(
        version=__version__,
        kind=learned.kind,
        axes=learned.axes,
        targets=learned.targets,
        forward=learned.forward,
        effort=learned.effort,
        correction=learned.correction,
        trained_on=TrainedOn(
            name=dataset.config.name,
            robot=dataset.config.robot.name,
            task=dataset.config.task.name,
            engine=dataset.config.sim.engine,
            digest=dataset.digest,
            throws=len(found.trials),
            ignored=found.ignored,
            selection=where,
            folds_error={degree: float(np.median(errors)) for degree, errors in validation.errors.items()},
            without_latents=found.without_latents,
            latents_count=found.latents_count,
        ),
        adaptation=None,
    )


def _read_places(argument: str, given: Iterable[Sequence[float]], names: Sequence[str]) -> Array:
    """Read targets, or places where throws ended, shape ``(n, n_names)``."""
    rows = [list(map(float, place)) for place in given]
    for row in rows:
        if len(row) != len(names) or not (np.abs(row) <= LARGEST_TARGET).all():
            wanted = f"finite numbers of at most {LARGEST_TARGET:g}: {', '.join(names)}"
            raise refuse_argument(argument, f"got {row}", expected=wanted)
    return np.array(rows, np.float64).reshape(-1, len(names))


def _check_scatter(scatter: float) -> None:
    """Refuse a number that is no standard deviation."""
    if not 0.0 <= scatter <= LARGEST_TARGET:
        expected = f"0 to {LARGEST_TARGET:g}, in the unit of the targets"
        raise refuse_argument("scatter", f"got {scatter}", expected=expected)
