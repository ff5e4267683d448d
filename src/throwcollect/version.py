"""The version, apart from the package's face so that rooms can tell it without looking at the rooms above them."""

__version__ = "0.2.0"
"""That of the distribution, too."""
