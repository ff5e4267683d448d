"""A fake Docker engine, which runs nothing and answers as late as a test wants."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from socketserver import ThreadingUnixStreamServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

VERSION = "1.41"


class Engine:
    """Containers by id, as an engine keeps them; they run until they are told to end.

    Attributes:
        containers: What the engine knows of each container.
        asked: Requests in the order in which they came, such as ``POST /containers/create``.
        printed: Lines that each container has printed, by its name.
        withheld: Requests that match are not answered before `answer_all`; None for none.
        root: The engine's data root.
    """

    def __init__(self) -> None:
        self.containers: dict[str, dict[str, Any]] = {}
        self.asked: list[str] = []
        self.withheld: str | None = None
        self.root = "/var/lib/docker"
        self.released = threading.Event()
        self.printed: dict[str, list[str]] = {}

    def answer_all(self) -> None:
        """Answer the withheld requests and all later ones."""
        self.withheld = None
        self.released.set()

    def names(self) -> list[str]:
        return sorted(each["Name"] for each in self.containers.values())

    def running(self) -> list[str]:
        return [each["Name"] for each in self.containers.values() if each["State"]["Running"]]

    def end(self, name: str, code: int) -> None:
        """Let a container end."""
        for each in self.containers.values():
            if each["Name"] == name:
                each["State"] |= {"Status": "exited", "Running": False, "ExitCode": code}

    def log(self, key: str, tail: str) -> bytes:
        """The last lines of a container, or all, with their times, as the engine sends them."""
        lines = self.printed.get(self.containers[key]["Name"], []) if key in self.containers else []
        stamped = [f"2026-01-01T00:00:00.{number:09}Z {line}\n".encode() for number, line in enumerate(lines)]
        shown = stamped if tail == "all" else stamped[-int(tail) :]
        return b"".join(b"\x01\0\0\0" + len(line).to_bytes(4, "big") + line for line in shown)

    def answer(self, method: str, path: str, query: dict[str, list[str]], body: Any) -> tuple[int, Any]:
        """Status and document."""
        match method, *path.strip("/").split("/"):
            case "GET", "version":
                return 200, {"ApiVersion": VERSION}
            case "GET", "info":
                return 200, {"DockerRootDir": self.root}
            case "GET", "networks":
                return 200, []
            case "POST", "networks", "create":
                return 201, {"Id": "net"}
            case "GET", "networks", name:
                return 200, {"Id": name, "Name": name}
            case "GET", "images", *_:
                return 200, {"Id": "image", "Config": {"Labels": {}}}
            case "POST", "containers", "create":
                name = query.get("name", ["without-name"])[0]
                return 201, {"Id": self.create(name, body["Labels"]), "Warnings": []}
            case "GET", "containers", "json":
                wanted = [label.split("=") for label in json.loads(query.get("filters", ["{}"])[0]).get("label", [])]
                return 200, [
                    self._list_entry(each)
                    for each in self.containers.values()
                    if all(
                        each["Config"]["Labels"].get(key) in (value or [each["Config"]["Labels"].get(key)])
                        for key, *value in wanted
                    )
                ]
            case _, "containers", key, *action:
                return self._on_container(method, key, action)
        return 404, {"message": f"no {method} {path}"}

    def create(self, name: str, labels: dict[str, str]) -> str:
        """Make a container and return its id."""
        key = f"{len(self.asked) + len(self.containers):064x}"
        state = {"Status": "created", "Running": False, "ExitCode": 0, "OOMKilled": False}
        config = {"Labels": labels, "Tty": False}
        self.containers[key] = {
            "Id": key,
            "Name": name,
            "State": state,
            "Config": config,
            "NetworkSettings": {"Networks": {}},
        }
        return key

    def _list_entry(self, container: dict[str, Any]) -> dict[str, Any]:
        labels, state = container["Config"]["Labels"], container["State"]["Status"]
        names = [f"/{container['Name']}"]
        networks = container["NetworkSettings"]
        return {"Id": container["Id"], "Names": names, "Labels": labels, "State": state, "NetworkSettings": networks}

    def _on_container(self, method: str, key: str, action: list[str]) -> tuple[int, Any]:
        if key not in self.containers:
            return 404, {"message": f"No such container: {key}"}
        state = self.containers[key]["State"]
        if method == "DELETE":
            del self.containers[key]
        elif action == ["json"]:
            return 200, self.containers[key]
        elif action == ["archive"]:
            return 200, None
        elif action == ["start"]:
            state |= {"Status": "running", "Running": True}
        elif action in (["stop"], ["kill"]):
            state |= {"Status": "exited", "Running": False, "ExitCode": 0}
        return 204, None


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    engine: Engine

    def _answer(self) -> None:
        parts = urlsplit(self.path)
        path = re.sub(r"^/v[0-9.]+(?=/)", "", parts.path)
        length = int(self.headers.get("Content-Length") or 0)
        content = self.rfile.read(length)
        body = json.loads(content) if content.startswith(b"{") else None
        asked = f"{self.command} {path}"
        self.engine.asked.append(asked)
        if self.engine.withheld is not None and re.search(self.engine.withheld, asked):
            self.engine.released.wait()
        if path.endswith("/logs"):
            key = path.split("/")[2]
            status, content = 200, self.engine.log(key, parse_qs(parts.query)["tail"][0])
        else:
            status, document = self.engine.answer(self.command, path, parse_qs(parts.query), body)
            content = b"" if document is None else json.dumps(document).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    do_GET = do_POST = do_PUT = do_DELETE = _answer  # noqa: N815

    def address_string(self) -> str:
        return "engine"

    def log_message(self, *_: object) -> None:
        pass

    def handle(self) -> None:
        with suppress(OSError):
            super().handle()


class _Server(ThreadingUnixStreamServer):
    daemon_threads = True
    block_on_close = False


@contextmanager
def engine_at(path: Path) -> Iterator[Engine]:
    """An engine that listens at a socket."""
    engine = Engine()
    with _Server(str(path), type("Handler", (_Handler,), {"engine": engine})) as server:
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
        try:
            yield engine
        finally:
            engine.answer_all()
            server.shutdown()
