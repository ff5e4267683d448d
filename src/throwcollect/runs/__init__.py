"""Runs: the command line and Python programs prepare, launch, follow, scale and end them with these functions.

A name is imported when it is used for the first time; see ``docs/runs.md``.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from throwcollect.runs.control import down as down
    from throwcollect.runs.control import scale as scale
    from throwcollect.runs.control import stop as stop
    from throwcollect.runs.following import Look as Look
    from throwcollect.runs.following import follow as follow
    from throwcollect.runs.following import wait as wait
    from throwcollect.runs.onlooker import Onlooker as Onlooker
    from throwcollect.runs.preparation import prepare as prepare
    from throwcollect.runs.preparation import resume as resume
    from throwcollect.runs.prepared_run import PreparedRun as PreparedRun
    from throwcollect.runs.record import Summary as Summary
    from throwcollect.runs.records import Run as Run
    from throwcollect.runs.selection import find as find
else:

    def __getattr__(name: str) -> object:
        from importlib import import_module

        modules = {
            "control": ("down", "scale", "stop"),
            "following": ("Look", "follow", "wait"),
            "onlooker": ("Onlooker",),
            "preparation": ("prepare", "resume"),
            "prepared_run": ("PreparedRun",),
            "record": ("Summary",),
            "records": ("Run",),
            "selection": ("find",),
        }
        for module, names in modules.items():
            if name in names:
                return getattr(import_module(f"throwcollect.runs.{module}"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})


__all__ = [
    "Look",
    "Onlooker",
    "PreparedRun",
    "Run",
    "Summary",
    "down",
    "find",
    "follow",
    "prepare",
    "resume",
    "scale",
    "stop",
    "wait",
]
