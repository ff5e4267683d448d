"""The origins of the trials of a derived dataset: a table of them, and a section of the data card."""

from __future__ import annotations

from collections.abc import Sequence

import pyarrow as pa

from throwcollect.dataset.throws_table import make_field
from throwcollect.derive.source import Source
from throwcollect.sweep.parquet_file import encode_table


def encode_sources(sources: Sequence[Source]) -> bytes:
    """Encode a table in Parquet with one row a trial: the dataset, trial and episode that it comes from."""
    rows: list[dict[str, object]] = []
    for source in sources:
        dataset = source.dataset
        digests = dataset.throws["digest"].take(source.trials).to_pylist()
        for number, digest in zip(source.trials, digests, strict=True):
            rows.append(
                {
                    "trial": len(rows),
                    "source_name": dataset.config.name,
                    "source_directory": str(dataset.directory),
                    "source_digest": dataset.digest,
                    "source_trial": number,
                    "source_trial_digest": dataset.plan.trial(number).digest,
                    "source_episode_digest": digest,
                }
            )
    return encode_table(pa.Table.from_pylist(rows, schema=_SOURCES))


def sources_section(sources: Sequence[Source]) -> str:
    """Write the section of the data card on the datasets that the trials come from."""
    lines = [
        "",
        "## Sources",
        "",
        "Derived from other datasets, in whose data cards the provenance of the simulations is; `sources.parquet` says "
        "which trial and episode of them each trial is, `trials.parquet` has the points of all trials.",
        "",
        "| dataset | directory | trials taken | of | digest |",
        "|---|---|---|---|---|",
    ]
    for source in sources:
        dataset = source.dataset
        cells = (dataset.config.name, dataset.directory, len(source.trials), len(dataset.throws), dataset.digest)
        lines.append(f"| {' | '.join(str(cell).replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join([*lines, ""])


_SOURCES = pa.schema(
    [
        make_field("trial", pa.int64(), "Number of the trial here."),
        make_field("source_name", pa.string(), "Name of the dataset that the trial comes from."),
        make_field("source_directory", pa.string(), "Directory of that dataset, as it was given."),
        make_field("source_digest", pa.string(), "Digest of that dataset."),
        make_field("source_trial", pa.int64(), "Number of the trial there."),
        make_field("source_trial_digest", pa.string(), "Digest of the trial in the plan there."),
        make_field("source_episode_digest", pa.string(), "Digest of the episode there."),
    ]
)
