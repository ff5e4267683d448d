"""Programs find a living server by its file, and ignore files of dead ones."""

from __future__ import annotations

import json
import stat
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from throwcollect.serve.finding import (
    Address,
    end_server,
    find_server,
    make_page_address,
    publish,
)


class Handler(BaseHTTPRequestHandler):
    """Answers as a server does."""

    status = 200
    text = b'{"status": "ok", "code": "abc"}'

    def do_GET(self) -> None:
        self.send_response(self.status)
        self.end_headers()
        self.wfile.write(self.text)

    do_POST = do_GET  # noqa: N815 - so they are found

    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def answering(status: int = 200, text: bytes = Handler.text) -> Iterator[Address]:
    handler = type("_Handler", (Handler,), {"status": status, "text": text})
    server = HTTPServer(("127.0.0.1", 0), handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield Address(f"http://127.0.0.1:{server.server_port}", "full", "read-only", 1)
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def test_a_server_is_found_as_long_as_it_serves(state: Path) -> None:
    with answering() as address:
        with publish(address):
            assert find_server() == address
            assert stat.S_IMODE((state / "serve.json").stat().st_mode) == 0o600
        assert find_server() is None
        assert not (state / "serve.json").exists()


def test_the_file_of_a_killed_server_is_ignored(state: Path) -> None:
    """Another process may have the port or the pid of the killed server by now."""
    with answering() as address:
        text = json.dumps(vars(address))
        code = (
            "import json, os, sys; from throwcollect.serve.finding import *\n"
            "with publish(Address(**json.loads(sys.argv[1]))): os._exit(0)"
        )
        subprocess.run([sys.executable, "-c", code, text], check=True)
        assert json.loads((state / "serve.json").read_text()) == vars(address)
        assert find_server() is None


def test_no_other_process_is_ended_that_has_the_pid_of_a_killed_server(state: Path) -> None:
    with subprocess.Popen(["sleep", "60"]) as other:
        address = Address("http://127.0.0.1:1", "full", "read-only", other.pid)
        with publish(address):
            text = (state / "serve.json").read_bytes()
        (state / "serve.json").write_bytes(text)
        assert end_server() is None
        assert other.poll() is None
        other.kill()


@pytest.mark.parametrize(
    "url", ["http://127.0.0.1:1", "http://127.0.0.1:x", "", "nonsense", "http://[::1", "http://a b:80"]
)
def test_a_server_that_does_not_answer_is_not_found(url: str) -> None:
    with publish(Address(url, "full", "read-only", 1)):
        assert find_server() is None


def test_the_first_of_two_servers_is_found(state: Path) -> None:
    with answering() as first, answering() as second, publish(first):
        with publish(second):
            assert find_server() == first
        assert find_server() == first


def test_the_address_of_the_page_has_a_code_and_names_the_run() -> None:
    with answering() as address:
        assert make_page_address(address, "small-1") == f"{address.url}/#code=abc&run=small-1"
        assert make_page_address(address) == f"{address.url}/#code=abc"
        assert "full" not in make_page_address(address)
