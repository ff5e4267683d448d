"""A server with a page, and the page in a browser."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from tests.commands import start_command
from tests.e2e.chromium import Tab
from throwcollect.collect.runs.records import Records

CHANGED = "ERR_NETWORK_CHANGED"
"""The error of a browser for requests that it breaks off when networks of containers come and go."""


@contextmanager
def serve(catalogue: Path, datasets: Path, models: Path | None = None) -> Iterator[dict[str, Any]]:
    """Serve a catalogue, and models; gives what `throwcollect serve --json` tells."""
    options = ("--port", "0", "--datasets", datasets, "--models", models or datasets, "--json")
    with start_command("serve", catalogue, *options, stderr=None) as server:
        assert server.stdout is not None
        try:
            yield json.loads(server.stdout.readline())
        finally:
            server.terminate()
            # Runs outlive their server, so they are ended here.
            for run in Records().all():
                if run.lives and datasets in run.record.directory.parents:
                    os.kill(run.record.launcher, signal.SIGTERM)


def load(tab: Tab) -> None:
    """Wait until the page works; it is loaded again if a change of a network made the browser give up on modules."""
    for _ in range(5):
        with suppress(AssertionError):
            tab.wait_for("document.querySelector('#components form') !== null", within_s=20)
            return
        assert any(CHANGED in error for error in tab.errors), tab.errors
        tab.ask("Page.reload")
    raise AssertionError(tab.errors)


def press(tab: Tab, button: str) -> None:
    tab.evaluate(f"document.querySelector('button[aria-label={json.dumps(button)}]').click()")


_SLIDE = """
((word, value) => {
  const labels = [...document.querySelectorAll("#sensor-form label")];
  const slider = labels.find(({ textContent }) => textContent.startsWith(word)).querySelector("input");
  slider.value = value;
  slider.dispatchEvent(new Event("input"));
})
"""


def slide(tab: Tab, word: str, value: float) -> None:
    """Move the slider of the form of a sensor whose label begins with a word."""
    tab.evaluate(f"{_SLIDE.strip()}({json.dumps(word)}, {value})")


def find_own_errors(tab: Tab) -> list[str]:
    """Errors of a page that are its own."""
    return [error for error in tab.errors if CHANGED not in error]


def wait_for(condition: Callable[[], Any], seconds: float = 60) -> Any:
    """Wait until a condition is true, and return its value."""
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, "did not happen"
        time.sleep(0.1)
    return found
