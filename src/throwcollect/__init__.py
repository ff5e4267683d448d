"""throwcollect: databases of robot throws from many simulations at once.

`load` is the way into a dataset from Python, `Simulator` gives single throws; what stands behind them is imported when
they are taken.
"""

from typing import TYPE_CHECKING

from throwcollect.version import __version__

if TYPE_CHECKING:
    from throwcollect.dataset.throw_dataset import load as load
    from throwcollect.simulator import Simulator as Simulator
else:

    def __getattr__(name: str) -> object:
        if name == "load":
            from throwcollect.dataset.throw_dataset import load

            return load
        if name == "Simulator":
            from throwcollect.simulator import Simulator

            return Simulator
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})


__all__ = ["Simulator", "__version__", "load"]
