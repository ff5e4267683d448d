"""throwcollect: databases of robot throws from many simulations at once.

`load` is the way into a dataset from Python; what stands behind it is imported when it is taken.
"""

from typing import TYPE_CHECKING

from throwcollect.version import __version__

if TYPE_CHECKING:
    from throwcollect.dataset.throw_dataset import load as load
else:

    def __getattr__(name: str) -> object:
        if name != "load":
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from throwcollect.dataset.throw_dataset import load

        return load

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})


__all__ = ["__version__", "load"]
