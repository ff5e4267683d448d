"""Runs: the command line and Python programs prepare, launch, follow, scale and end them with these functions.

A name is imported when it is used for the first time; see ``docs/running.md``.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from throwcollect.coordinator.onlooker import Onlooker as Onlooker
    from throwcollect.runs.control import down as down
    from throwcollect.runs.control import scale as scale
    from throwcollect.runs.control import stop as stop
    from throwcollect.runs.following import RunUpdate as RunUpdate
    from throwcollect.runs.following import follow as follow
    from throwcollect.runs.following import wait as wait
    from throwcollect.runs.preparation import prepare as prepare
    from throwcollect.runs.preparation import resume as resume
    from throwcollect.runs.run import Run as Run
    from throwcollect.runs.run_record import Summary as Summary
    from throwcollect.runs.run_selection import find as find
else:
    _PLACES = {
        "Onlooker": "coordinator.onlooker:Onlooker",
        "Run": "runs.run:Run",
        "RunUpdate": "runs.following:RunUpdate",
        "Summary": "runs.run_record:Summary",
        "down": "runs.control:down",
        "find": "runs.run_selection:find",
        "follow": "runs.following:follow",
        "prepare": "runs.preparation:prepare",
        "resume": "runs.preparation:resume",
        "scale": "runs.control:scale",
        "stop": "runs.control:stop",
        "wait": "runs.following:wait",
    }
    __all__ = list(_PLACES)

    def __getattr__(name: str) -> object:
        """Import the object with a public name.

        Raises:
            AttributeError: If there is no such name.
            MissingExtraError: If the object needs an extra that is not installed.
        """
        from importlib import import_module

        from throwcollect.extras import explain_missing

        if name not in _PLACES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        module, name = _PLACES[name].split(":")
        with explain_missing():
            return getattr(import_module(f"throwcollect.{module}"), name)

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
