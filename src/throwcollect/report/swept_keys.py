"""Swept keys: how the values of each are spread, and with which outcomes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.schema import Config, Range
from throwcollect.config.shape import unit_of_key
from throwcollect.config.values import keys_by_column
from throwcollect.report.outcomes import Outcomes
from throwcollect.report.plotted_points import read_numbers

_BINS = 12


@dataclass(frozen=True)
class SweptKey:
    """One swept key.

    Attributes:
        key: Dotted key.
        unit: Unit of its values; empty if they have none.
        logarithmic: True if its logarithm, and not its value, was drawn evenly.
        values: Value of each trial, shape ``(n_trials,)``.
        edges: Edges of the bins, shape ``(n_bins + 1,)``; around each value if there are only a few.
        counts: Trials in each bin by outcome, shape ``(n_bins, n_outcomes)``.
        steps: The distinct values, one a bin, if there are only a few; else None.
    """

    key: str
    unit: str
    logarithmic: bool
    values: NDArray[np.float64]
    edges: NDArray[np.float64]
    counts: NDArray[np.intp]
    steps: NDArray[np.float64] | None

    @property
    def ticks(self) -> dict[str, list[Any]]:
        """Ticks of a logarithmic axis for plotly: its own are powers of ten, and most ranges contain none."""
        values = [float(f"{value:.2g}") for value in np.geomspace(self.edges[0], self.edges[-1], 3)]
        return {"tickvals": values, "ticktext": [f"{value:g}" for value in values]}

    @property
    def short_label(self) -> tuple[str, str]:
        """Last part of the key, and the parts before it with the unit."""
        above, _, last = self.key.rpartition(".")
        return last, f"{above} [{self.unit or '-'}]".strip()


def read_parameters(config: Config, throws: pa.Table, outcomes: Outcomes) -> tuple[SweptKey, ...]:
    """Read all swept keys of a table of throws, in its order."""
    columns = keys_by_column(config, throws.column_names)
    return tuple(_read_parameter(config, key, read_numbers(throws, name), outcomes) for name, key in columns.items())


def _read_parameter(config: Config, key: str, values: NDArray[np.float64], outcomes: Outcomes) -> SweptKey:
    swept = config.sweep.parameters.get(key)
    logarithmic = isinstance(swept, Range) and swept.scale == "log"
    distinct = np.unique(values)
    steps = distinct if len(distinct) <= _BINS else None
    if steps is not None:
        edges = np.exp(_surround(np.log(steps))) if logarithmic and len(steps) > 1 else _surround(steps)
        bins = np.searchsorted(steps, values)
    else:
        low, high = (swept.min, swept.max) if isinstance(swept, Range) else (distinct[0], distinct[-1])
        # Bins have to cover all values, also those outside of the range of the sweep.
        low, high = min(low, float(distinct[0])), max(high, float(distinct[-1]))
        edges = np.geomspace(low, high, _BINS + 1) if logarithmic else np.linspace(low, high, _BINS + 1)
        # The largest value lies on the last edge, and belongs to the last bin.
        bins = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, _BINS - 1)
    counts = np.zeros((len(edges) - 1, len(outcomes.names)), dtype=np.intp)
    np.add.at(counts, (bins, outcomes.codes), 1)
    return SweptKey(key, unit_of_key(key), logarithmic, values, edges, counts, steps)


def _surround(steps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place edges half-way between values, and as far beyond the first and the last."""
    if len(steps) == 1:
        half = abs(steps[0]) / 2 or 0.5
        return np.array([steps[0] - half, steps[0] + half])
    middles = (steps[:-1] + steps[1:]) / 2
    return np.concatenate([[2 * steps[0] - middles[0]], middles, [2 * steps[-1] - middles[-1]]])
