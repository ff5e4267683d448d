"""Where a dataset came from: what its data card and its configuration say."""

from __future__ import annotations

from throwcollect.dataset.directory import CARD, CONFIG
from throwcollect.dataset.inspect import Info
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import DatasetError
from throwcollect.sweep.digest import config_digest

_HEADING = "## Provenance"


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
        text = (dataset.directory / CARD).read_text(encoding="utf-8", errors="replace")
    except OSError:
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
    path = dataset.directory / CONFIG
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise DatasetError(f"{path}: cannot be read: {error.strerror}") from error
