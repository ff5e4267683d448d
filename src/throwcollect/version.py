"""The version. It is not in the package's `__init__`, which all rooms would then have to import."""

__version__ = "0.2.0"
"""Version of the package and of the distribution."""
