"""The origin of a dataset: its digests, and how it was collected."""

from __future__ import annotations

from throwcollect.dataset.directory import PROVENANCE
from throwcollect.dataset.provenance import read_provenance
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.summary import Info
from throwcollect.sweep.digest import config_digest


def provenance(dataset: Dataset, info: Info) -> dict[str, str]:
    """Facts on a dataset by name: digests first, then how it was collected, if that is known."""
    collected = read_provenance(dataset.directory)
    return {
        "dataset digest": info.digest,
        "configuration digest": config_digest(dataset.config),
        "layout": dataset.layout,
        "sampler": f"{dataset.config.sweep.sampler}, seed {dataset.config.seed}",
        **(collected.facts() if collected else {"collected": f"unknown: it has no readable {PROVENANCE}"}),
    }
