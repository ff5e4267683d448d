"""The table of throws and the time series of each throw, as text with commas."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
from pyarrow.csv import write_csv

from throwcollect.publish.export.exporter import Exporter, Layout, tabulate_signals
from throwcollect.publish.export.throw_source import ExportSource


def describe(source: ExportSource) -> Layout:
    """Say how `write` lays a source out."""
    return Layout(
        files={"throws.csv": "one row a trial.", "trial_N.csv": "the time series of trial N."},
        loading='import pandas as pd\n\nthrows = pd.read_csv("throws.csv")',
        over_time=tabulate_signals(source, columns=True),
    )


def write(source: ExportSource, directory: Path) -> None:
    """Write a dataset as text; see `Exporter.write`."""
    write_csv(source.table, directory / "throws.csv")
    for throw in source.read(source.throws):
        columns: dict[str, pa.Array] = {}
        for signal in source.signals:
            rows = throw.signals[signal.name].reshape(len(throw), -1)
            columns |= dict(zip(signal.columns, map(pa.array, rows.T), strict=True))
        write_csv(pa.table(columns), directory / f"trial_{throw.throw.trial}.csv")


CSV = Exporter(describe, write)
