"""The user's own file with the keys of `cluster` that hold for all collections on a cluster."""

from __future__ import annotations

import os
from pathlib import Path

from throwcollect.config.cluster import ClusterConfig
from throwcollect.config.document import Document


def site_path() -> Path:
    """Name the path of the file, which need not exist."""
    home = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    return Path(home) / "throwcollect" / "cluster.yaml"


def with_site(cluster: ClusterConfig) -> ClusterConfig:
    """Complete the section `cluster` of a configuration by the user's file; keys that the section sets itself win."""
    path = site_path()
    if not path.is_file():
        return cluster
    site = Document(path).validate(ClusterConfig)
    own = {name: getattr(cluster, name) for name in cluster.model_fields_set}
    return site.model_copy(update=own)
