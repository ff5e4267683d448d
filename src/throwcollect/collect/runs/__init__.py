"""Runs: the command line and Python programs prepare, launch, follow, scale and end them with these functions.

A name is imported when it is used for the first time; see ``docs/running.md``.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from throwcollect.collect.coordinator.reporter import Reporter as Reporter
    from throwcollect.collect.runs.control import down as down
    from throwcollect.collect.runs.control import scale as scale
    from throwcollect.collect.runs.control import stop as stop
    from throwcollect.collect.runs.following import RunUpdate as RunUpdate
    from throwcollect.collect.runs.following import follow as follow
    from throwcollect.collect.runs.following import wait as wait
    from throwcollect.collect.runs.preparation import prepare as prepare
    from throwcollect.collect.runs.preparation import resume as resume
    from throwcollect.collect.runs.run import Run as Run
    from throwcollect.collect.runs.run_selection import find as find
    from throwcollect.dataset.summary import Info as Summary  # noqa: F401
else:
    _PLACES = {
        "Reporter": "collect.coordinator.reporter:Reporter",
        "Run": "collect.runs.run:Run",
        "RunUpdate": "collect.runs.following:RunUpdate",
        "Summary": "dataset.summary:Info",
        "down": "collect.runs.control:down",
        "find": "collect.runs.run_selection:find",
        "follow": "collect.runs.following:follow",
        "prepare": "collect.runs.preparation:prepare",
        "resume": "collect.runs.preparation:resume",
        "scale": "collect.runs.control:scale",
        "stop": "collect.runs.control:stop",
        "wait": "collect.runs.following:wait",
    }
    __all__ = list(_PLACES)

    def __getattr__(name: str) -> object:
        from throwcollect.extras import import_public

        return import_public(__name__, _PLACES, name)

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
