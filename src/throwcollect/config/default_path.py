"""The configuration that commands read if none is named; in a module of its own, so that importing it is cheap."""

from pathlib import Path

DEFAULT_CONFIG = Path("throwcollect.yaml")
