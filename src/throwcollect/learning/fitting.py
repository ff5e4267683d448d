"""Learns a model from the throws of a dataset."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from throwcollect.config.motion import MotionFile
from throwcollect.config.schema import Config
from throwcollect.config.task_config import TaskConfig
from throwcollect.config.values import column_of, leaves
from throwcollect.dataset.carried_robot import config_text
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.files import StrPath
from throwcollect.learning.learned_map import EFFORT, Axis, KeyRole, count_needed_throws, fit_throws
from throwcollect.learning.model import MODEL, Model, load_model
from throwcollect.learning.model_card import TrainedOn
from throwcollect.learning.polynomial import Array
from throwcollect.version import __version__
from throwcollect.wording import format_count, suggest


def fit(
    dataset: Dataset | StrPath,
    *,
    targets: Sequence[str] = (),
    parameters: Sequence[str] = (),
    given: Sequence[str] = (),
) -> Model:
    """Learn a model from the throws of a dataset that succeeded.

    Args:
        dataset: The dataset, or its directory.
        targets: Columns that say where a trial ended; those of the task by default.
        parameters: Swept keys that aiming chooses; all of the task by default. The others belong to the world.
        given: Swept keys whose values are given with a target; those that the task names by default.

    Raises:
        ConfigError: If there is nothing to aim at, a key was not swept, or too few throws succeeded.
        DatasetError: If the directory holds no finished dataset, or the dataset is damaged.
    """
    if not isinstance(dataset, Dataset):
        dataset = Dataset.open(dataset)
    config = dataset.config
    if isinstance(config.task.trajectory, MotionFile):
        hint = "sweep parameters of a motion; throwcollect fit-dmp finds those of a motion of a file"
        raise ConfigError(f"{dataset.directory} has motions of a file, and there is nothing between them", hint=hint)
    columns = tuple(targets) or config.task.targets
    if not columns:
        raise ConfigError(
            f"the task {config.task.name} names no targets", expected="columns of the table of throws as targets"
        )
    throws = keep_informative(config.task, dataset.throws, columns)
    axes = _find_axes(dataset, throws, parameters, given)
    _check_amount(dataset, throws, axes)
    outputs = np.column_stack([_read_numbers(throws, column, dataset) for column in columns])
    values = np.column_stack([_read_numbers(throws, column_of(axis.key), dataset) for axis in axes])
    return Model(
        **dict(fit_throws(axes, columns, values, outputs, _read_numbers(throws, EFFORT, dataset))),
        version=__version__,
        trained_on=TrainedOn(
            name=config.name,
            robot=config.robot.name,
            task=config.task.name,
            engine=config.sim.engine,
            digest=dataset.digest,
            throws=len(throws),
            ignored=len(dataset) - len(throws),
        ),
        config=config_text(config),
        source=dataset.directory,
    )


def keep_informative(task: TaskConfig, throws: pa.Table, targets: Sequence[str]) -> pa.Table:
    """Keep the rows of a table of throws that show where their motions lead, in these columns of targets."""
    outcomes = pa.array([task.success, *task.informative])
    throws = throws.filter(pc.is_in(throws["outcome"], outcomes))
    for name in targets:
        # A column that does not exist is reported later.
        if name in throws.column_names:
            throws = throws.filter(pc.is_valid(throws[name]))
    return throws


def _find_axes(
    dataset: Dataset, throws: pa.Table, parameters: Sequence[str], context: Sequence[str]
) -> tuple[Axis, ...]:
    """List the swept keys as inputs: parameters, context, latents."""
    swept = dataset.plan.keys
    for key in (*parameters, *context):
        if key not in swept:
            raise ConfigError(f"{key} was not swept{suggest(key, swept)}")
    nominal = {leaf.name: leaf.value for leaf in leaves(dataset.config)}
    axes = []
    for key in swept:
        ends = pc.min_max(throws[column_of(key)]).as_py()
        low, high = ends["min"], ends["max"]
        role = _choose_role(dataset.config, key, parameters, context)
        # Nothing can be learned about a key with one value, and scaling would divide by zero. With a single throw, no
        # key varies; such a dataset is refused later, because it has too few throws.
        if low == high and len(throws) > 1:
            if key in (*parameters, *context):
                raise ConfigError(f"{key} has the value {low:g} in all throws", expected="a key that varies")
            continue
        axes.append(Axis(key, role, low, high, float(nominal[key])))
    # `LearnedMap.columns_of` relies on axes of the same role being side by side.
    return tuple(sorted(axes, key=lambda axis: list(KeyRole).index(axis.role)))


def _choose_role(config: Config, key: str, parameters: Sequence[str], context: Sequence[str]) -> KeyRole:
    if key in context or (not context and key in config.task.given):
        return KeyRole.CONTEXT
    chosen = key in parameters if parameters else key.startswith("task.")
    return KeyRole.PARAMETER if chosen else KeyRole.LATENT


def _check_amount(dataset: Dataset, throws: pa.Table, axes: tuple[Axis, ...]) -> None:
    """Refuse a dataset that no model can be learned from."""
    chosen = [axis.key for axis in axes if axis.role is KeyRole.PARAMETER]
    if not chosen:
        raise ConfigError(
            f"{dataset.directory}: no parameter of the task varies",
            expected="a sweep of task.… keys, or other parameters",
        )
    if len(throws) < (needed := count_needed_throws(len(chosen))):
        raise ConfigError(
            f"{dataset.directory}: {format_count(len(throws), dataset.config.task.noun)} of {len(dataset)} "
            f"{dataset.config.task.success}",
            expected=f"at least {needed} for {format_count(len(chosen), 'parameter')}",
        )


def _read_numbers(throws: pa.Table, column: str, dataset: Dataset) -> Array:
    """Read a column of finite numbers."""
    if column not in throws.column_names or not pa.types.is_floating(throws.schema.field(column).type):
        numbers = [field.name for field in throws.schema if pa.types.is_floating(field.type)]
        raise ConfigError(f"no column of numbers {column!r}{suggest(column, numbers, 'docs/dataset.md')}")
    values: Array = throws[column].to_numpy()
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        trial = throws["trial"][int(wrong[0])].as_py()
        raise DatasetError(f"{column} of trial {trial} is {values[wrong[0]]}", path=dataset.directory)
    return values


def read_ends(directory: Path) -> Array:
    """Read where the throws of a model or of a dataset ended, shape ``(n, n_targets)``.

    Raises:
        ConfigError: If no throw succeeded, or its task has nothing to aim at.
    """
    if (directory / MODEL).exists():
        return load_model(directory).outputs
    dataset = Dataset.open(directory)
    task = dataset.config.task
    throws = keep_informative(task, dataset.throws, task.targets)
    if not task.targets or not len(throws):
        raise ConfigError(f"{directory}: no throw shows a target", expected="a dataset with throws that succeeded")
    return np.column_stack([throws[name].to_numpy() for name in task.targets])
