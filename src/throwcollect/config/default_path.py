"""Where commands look for a configuration if none is named."""

from pathlib import Path

DEFAULT_CONFIG = Path("throwcollect.yaml")
