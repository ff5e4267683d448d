"""throwcollect: databases of robot throws from many simulations at once."""

from throwcollect.loading import load

__version__ = "0.1.0"
__all__ = ["__version__", "load"]
