"""The configuration that commands take if none is named; apart from others, because its import is cheap."""

from pathlib import Path

DEFAULT_CONFIG = Path("throwcollect.yaml")
