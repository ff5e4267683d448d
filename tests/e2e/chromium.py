"""A headless Chromium, driven by its DevTools protocol."""

from __future__ import annotations

import base64
import json
import re
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

FLAGS = (
    "--headless=new",
    "--hide-scrollbars",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--ignore-gpu-blocklist",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
    "--remote-debugging-port=0",
)
"""Options of Chromium: software draws, without screen and GPU."""


def chromium() -> str | None:
    """Path of a Chromium; None if there is none."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


class ReloadedError(Exception):
    """The page was loaded anew before it answered."""


@dataclass
class Tab:
    """A tab, and what it told on its own.

    Attributes:
        errors: Errors of the console, and exceptions that nobody caught.
        requests: URLs of all requests and sockets.
    """

    socket: ClientConnection
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    _count: int = 0

    def ask(self, method: str, **parameters: Any) -> Any:
        self._count += 1
        self.socket.send(json.dumps({"id": self._count, "method": method, "params": parameters}))
        while True:
            message = json.loads(self.socket.recv(timeout=60))
            if message.get("id") == self._count:
                if "navigated" in message.get("error", {}).get("message", ""):
                    raise ReloadedError
                assert "error" not in message, message
                return message["result"]
            self._hear(message["method"], message["params"])

    def evaluate(self, expression: str) -> Any:
        """The value of an expression of JavaScript; promises are awaited."""
        answer = self.ask("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait_for(self, expression: str, *, within_s: float = 60.0, every_s: float = 0.3) -> Any:
        """Wait until an expression is true; the page may be loaded anew meanwhile."""
        end = time.monotonic() + within_s
        while True:
            with suppress(ReloadedError):
                if value := self.evaluate(expression):
                    return value
            assert time.monotonic() < end, f"never: {expression}; errors: {self.errors}"
            time.sleep(every_s)

    def picture(self, path: Path) -> None:
        """Write what is seen as PNG."""
        path.write_bytes(base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"]))

    def _hear(self, method: str, parameters: dict[str, Any]) -> None:
        if method == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description") or details["text"])
        elif method == "Runtime.consoleAPICalled" and parameters["type"] == "error":
            self.errors.append(" ".join(str(each.get("value", each.get("description"))) for each in parameters["args"]))
        elif method == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.errors.append(f"{parameters['entry']['text']} {parameters['entry'].get('url', '')}")
        elif method == "Network.requestWillBeSent":
            self.requests.append(parameters["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.requests.append(parameters["url"])


@contextmanager
def browse(
    url: str, *, width: int = 1280, height: int = 800, features: dict[str, str] | None = None, script: str = ""
) -> Iterator[Tab]:
    """Open a page in a browser of its own.

    Args:
        url: The page.
        width: Of the window [px].
        height: Of the window [px].
        features: Values of media features, such as ``{"prefers-color-scheme": "dark"}``.
        script: What runs before the scripts of each page.
    """
    found = chromium()
    assert found is not None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [found, *FLAGS, f"--user-data-dir={profile}", f"--window-size={width},{height}", "about:blank"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True)
        try:
            with connect(_first_tab(process), max_size=None) as socket:
                tab = Tab(socket)
                for domain in ("Page", "Runtime", "Log", "Network"):
                    tab.ask(f"{domain}.enable")
                metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
                tab.ask("Emulation.setDeviceMetricsOverride", **metrics)
                media = [{"name": name, "value": value} for name, value in (features or {}).items()]
                tab.ask("Emulation.setEmulatedMedia", features=media)
                tab.ask("Page.addScriptToEvaluateOnNewDocument", source=script)
                tab.ask("Page.navigate", url=url)
                yield tab
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(20)


def _first_tab(process: subprocess.Popen[bytes]) -> str:
    """Address of the first tab's socket."""
    assert process.stderr is not None
    found = _search(process.stderr.readline, rb"ws://(\S+?)/devtools/browser")
    from urllib.request import urlopen

    with urlopen(f"http://{found.decode()}/json/list", timeout=20) as response:
        return str(next(each for each in json.load(response) if each["type"] == "page")["webSocketDebuggerUrl"])


def _search(read_line: Callable[[], bytes], pattern: bytes) -> bytes:
    while line := read_line():
        if match := re.search(pattern, line):
            return match[1]
    raise AssertionError("Chromium ended before it told its port")
