"""Where a dataset came from: its digests, and how it was collected."""

from __future__ import annotations

from throwcollect.dataset.directory import CONFIG, PROVENANCE
from throwcollect.dataset.provenance import read_provenance
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.summary import Info
from throwcollect.files import read_text
from throwcollect.sweep.digest import config_digest

_MOST_BYTES = 10_000_000


def provenance(dataset: Dataset, info: Info) -> dict[str, str]:
    """Facts by name: digests first, then how it was collected, as far as that is known."""
    collected = read_provenance(dataset.directory)
    return {
        "dataset digest": info.digest,
        "configuration digest": config_digest(dataset.config),
        "layout": dataset.layout,
        "sampler": f"{dataset.config.sweep.sampler}, seed {dataset.config.seed}",
        **(collected.facts() if collected else {"collected": f"unknown: it has no readable {PROVENANCE}"}),
    }


def config_text(dataset: Dataset) -> str:
    """``config.yaml`` as it is.

    Raises:
        DatasetError: If it cannot be read.
    """
    return read_text(dataset.directory / CONFIG, most_bytes=_MOST_BYTES)
