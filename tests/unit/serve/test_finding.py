"""Programs find a living server by its file, and ignore files of dead ones."""

from __future__ import annotations

import json
import stat
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from throwcollect.errors import WorkerError
from throwcollect.serve.finding import Address, end_server, find_server, make_page_address, publish

ADDRESS = Address("http://127.0.0.1:1", "full", "read-only", 1)


def test_a_server_is_found_as_long_as_it_serves(state: Path) -> None:
    with publish(ADDRESS):
        assert find_server() == ADDRESS
        assert stat.S_IMODE((state / "serve.json").stat().st_mode) == 0o600
    assert find_server() is None
    assert not (state / "serve.json").exists()


def test_the_file_of_a_killed_server_is_ignored(state: Path) -> None:
    """Another process may have the port or the pid of the killed server by now."""
    code = (
        "import json, os, sys; from throwcollect.serve.finding import *\n"
        "with publish(Address(**json.loads(sys.argv[1]))): os._exit(0)"
    )
    subprocess.run([sys.executable, "-c", code, json.dumps(vars(ADDRESS))], check=True)
    assert json.loads((state / "serve.json").read_text()) == vars(ADDRESS)
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
def test_a_server_that_does_not_answer_is_named(url: str) -> None:
    with pytest.raises(WorkerError, match="the server does not answer"):
        make_page_address(Address(url, "full", "read-only", 1))


def test_the_first_of_two_servers_is_found(state: Path) -> None:
    with publish(ADDRESS):
        with publish(Address("http://127.0.0.1:2", "full", "read-only", 2)):
            assert find_server() == ADDRESS
        assert find_server() == ADDRESS


class Handler(BaseHTTPRequestHandler):
    """Answers as a server does."""

    def do_POST(self) -> None:
        self.send_response(201)
        self.end_headers()
        self.wfile.write(b'{"code": "abc"}')

    def log_message(self, *_: object) -> None:
        pass


def test_the_address_of_the_page_has_a_code_and_names_the_run() -> None:
    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=lambda: [server.handle_request() for _ in range(2)])
        thread.start()
        address = Address(f"http://127.0.0.1:{server.server_port}", "full", "read-only", 1)
        assert make_page_address(address, "small-1") == f"{address.url}/#code=abc&run=small-1"
        assert make_page_address(address) == f"{address.url}/#code=abc"
        thread.join()
