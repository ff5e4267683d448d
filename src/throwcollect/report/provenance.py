"""Where a dataset came from: what its data card and its configuration say."""

from __future__ import annotations

from throwcollect.dataset.directory import CARD, CONFIG
from throwcollect.dataset.inspect import Info
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import DatasetError
from throwcollect.files import read_text
from throwcollect.sweep.digest import config_digest

_HEADING = "## Provenance"
_MOST_BYTES = 10_000_000


def provenance(dataset: Dataset, info: Info) -> dict[str, str]:
    """Facts by name: digests first, then what the data card says; what it does not say is left out."""
    return {
        "dataset digest": info.digest,
        "configuration digest": config_digest(dataset.config),
        "layout": str(dataset.bag["custom_data"].get("throwcollect.format", "unknown")),
        "sampler": f"{dataset.config.sweep.sampler}, seed {dataset.config.seed}",
        **_card_facts(dataset),
    }


def _card_facts(dataset: Dataset) -> dict[str, str]:
    try:
        text = read_text(dataset.directory / CARD, most_bytes=_MOST_BYTES)
    except DatasetError:
        return {}
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.partition(_HEADING)[2].splitlines()
        if line.startswith("|")
    ]
    return {row[0]: row[1] for row in rows if len(row) == 2 and row[0].strip("-")}


def config_text(dataset: Dataset) -> str:
    """``config.yaml`` as it is.

    Raises:
        DatasetError: If it cannot be read.
    """
    return read_text(dataset.directory / CONFIG, most_bytes=_MOST_BYTES)
