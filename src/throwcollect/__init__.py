"""throwcollect: databases of robot throws from many simulations at once.

`__all__` lists the names that other programs may use; `docs/python.md` describes them. `import throwcollect` costs
nothing, because each name is imported when it is first used. A name that needs an extra fails at that moment.
"""

from typing import TYPE_CHECKING

from throwcollect.version import __version__

if TYPE_CHECKING:
    from throwcollect import gym
    from throwcollect.collect import runs
    from throwcollect.config.loader import load as load_config
    from throwcollect.config.schema import Config
    from throwcollect.dataset.derive.derivation import filter_trials as filter_dataset
    from throwcollect.dataset.derive.derivation import merge as merge_datasets
    from throwcollect.dataset.derive.derivation import sample as sample_dataset
    from throwcollect.dataset.derive.split import split as split_dataset
    from throwcollect.dataset.derive.statistics import statistics as compute_statistics
    from throwcollect.dataset.reader import Dataset, load
    from throwcollect.dataset.throw import Throw
    from throwcollect.errors import (
        ConfigError,
        ConflictError,
        DatasetError,
        NotFoundError,
        PlanError,
        ThrowcollectError,
        WorkerError,
    )
    from throwcollect.extras import MissingExtraError
    from throwcollect.learning.aiming import Aim
    from throwcollect.learning.fitting import fit
    from throwcollect.learning.model import Model, load_model
    from throwcollect.learning.score import Score
    from throwcollect.publish.export.export import export as export_dataset
    from throwcollect.publish.export.frame_dataset import FrameDataset
    from throwcollect.replay import verify_dataset
    from throwcollect.simulator import Simulator

__all__ = [
    "Aim",
    "Config",
    "ConfigError",
    "ConflictError",
    "Dataset",
    "DatasetError",
    "FrameDataset",
    "MissingExtraError",
    "Model",
    "NotFoundError",
    "PlanError",
    "Score",
    "Simulator",
    "Throw",
    "ThrowcollectError",
    "WorkerError",
    "__version__",
    "compute_statistics",
    "export_dataset",
    "filter_dataset",
    "fit",
    "gym",
    "load",
    "load_config",
    "load_model",
    "merge_datasets",
    "runs",
    "sample_dataset",
    "split_dataset",
    "verify_dataset",
]

_PLACES = {
    "Aim": "learning.aiming:Aim",
    "Config": "config.schema:Config",
    "ConfigError": "errors:ConfigError",
    "ConflictError": "errors:ConflictError",
    "Dataset": "dataset.reader:Dataset",
    "DatasetError": "errors:DatasetError",
    "FrameDataset": "publish.export.frame_dataset:FrameDataset",
    "MissingExtraError": "extras:MissingExtraError",
    "Model": "learning.model:Model",
    "NotFoundError": "errors:NotFoundError",
    "PlanError": "errors:PlanError",
    "Score": "learning.score:Score",
    "Simulator": "simulator:Simulator",
    "Throw": "dataset.throw:Throw",
    "ThrowcollectError": "errors:ThrowcollectError",
    "WorkerError": "errors:WorkerError",
    "compute_statistics": "dataset.derive.statistics:statistics",
    "export_dataset": "publish.export.export:export",
    "filter_dataset": "dataset.derive.derivation:filter_trials",
    "fit": "learning.fitting:fit",
    "gym": "gym",
    "load": "dataset.reader:load",
    "load_config": "config.loader:load",
    "load_model": "learning.model:load_model",
    "merge_datasets": "dataset.derive.derivation:merge",
    "runs": "collect.runs",
    "sample_dataset": "dataset.derive.derivation:sample",
    "split_dataset": "dataset.derive.split:split",
    "verify_dataset": "replay:verify_dataset",
}
"""Module and attribute of each name, or a module alone, for `__getattr__`; type checkers need the imports above."""


def __getattr__(name: str) -> object:
    from throwcollect.extras import import_public

    return import_public(__name__, _PLACES, name)


def __dir__() -> list[str]:
    return __all__
