"""Programs find a living server by its file, and ignore files of dead ones."""

from __future__ import annotations

import json
import signal
import stat
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from throwcollect.errors import DatasetError, WorkerError
from throwcollect.serve import finding
from throwcollect.serve.finding import (
    Address,
    end_server,
    ensure_server,
    find_living,
    find_server,
    log_path,
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


ENDLESS = """
import os, signal
from throwcollect.serve.finding import Address, publish
signal.signal(signal.SIGTERM, signal.SIG_IGN)
with publish(Address("http://127.0.0.1:1", "full", "read-only", os.getpid())):
    print("published", flush=True)
    signal.pause()
"""


def test_a_server_that_does_not_end_is_ended_by_force(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(finding, "_END_S", 0.2)
    with subprocess.Popen([sys.executable, "-c", ENDLESS], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        assert (ended := end_server()) is not None
        assert ended.pid == process.pid
        assert process.wait(timeout=10) == -signal.SIGKILL
    assert find_living() is None
    assert end_server() is None


def test_no_other_process_is_ended_that_has_the_pid_of_a_killed_server(state: Path) -> None:
    with subprocess.Popen(["sleep", "60"]) as other:
        address = Address("http://127.0.0.1:1", "full", "read-only", other.pid)
        with publish(address):
            text = (state / "serve.json").read_bytes()
        (state / "serve.json").write_bytes(text)
        assert end_server() is None
        assert other.poll() is None
        other.kill()


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"url": 7}', '{"url": "x", "token": "y"}', "\xff"])
def test_a_damaged_file_names_no_server(state: Path, text: str) -> None:
    with answering() as address, publish(address):
        (state / "serve.json").write_bytes(text.encode("latin-1"))
        assert find_server() is None


@pytest.mark.parametrize(
    "url", ["http://127.0.0.1:1", "http://127.0.0.1:x", "", "nonsense", "http://[::1", "http://a b:80"]
)
def test_a_server_that_does_not_answer_is_not_found(url: str) -> None:
    with publish(Address(url, "full", "read-only", 1)):
        assert find_server() is None


@pytest.mark.parametrize(("status", "text"), [(500, b"{}"), (200, b"<html>"), (200, b"[]"), (421, b"{}")])
def test_a_wrong_health_answer_is_not_taken_for_a_server(status: int, text: bytes) -> None:
    with answering(status, text) as address, publish(address):
        assert find_server() is None
        with pytest.raises(WorkerError, match="the server does not answer"):
            make_page_address(address)


def test_the_second_of_two_servers_is_found_when_the_first_has_ended(state: Path) -> None:
    with answering() as first, answering() as second:
        with publish(first):
            with publish(second):
                assert find_server() == first
            assert find_server() == first
            # The second server has ended before the first one, so it is not found afterwards.
        waiting = replace(second, pid=2)
        with publish(waiting):
            for _ in range(200):
                if find_server() == waiting:
                    break
                threading.Event().wait(0.01)
            assert find_server() == waiting


def test_publishing_an_address_on_a_full_disk_is_an_error(state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(path: Path, data: bytes) -> None:
        raise DatasetError("cannot be written: No space left on device", path=path)

    monkeypatch.setattr(finding, "write_secret", fail)
    with pytest.raises(DatasetError, match="No space left"), publish(Address("http://127.0.0.1:1", "a", "b", 1)):
        pass


def test_the_address_of_the_page_has_a_code_and_names_the_run() -> None:
    with answering() as address:
        assert make_page_address(address, "small-1") == f"{address.url}/#code=abc&run=small-1"
        assert make_page_address(address) == f"{address.url}/#code=abc"
        assert "full" not in make_page_address(address)


def test_a_server_that_fails_to_start_is_an_error_with_its_output(
    state: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    script = tmp_path / "python"
    script.write_text("#!/bin/sh\necho 'throwcollect: no such thing' >&2; exit 2\n")
    script.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(script))
    with pytest.raises(WorkerError, match="no server starts") as error:
        ensure_server()
    assert error.value.evidence == "throwcollect: no such thing"


LINES = """
import logging, os, sys
from throwcollect.serve import server_process
server_process._LOG_BYTES = 10_000
server_process._write_lines()
for number in range(1_000):
    logging.getLogger("throwcollect.serve").info("GET /api/v1/state %d", number)
print("an error", file=sys.stderr)
"""


def test_the_log_of_a_server_in_the_background_is_cut(state: Path) -> None:
    log = log_path()
    with log.open("ab") as output:
        subprocess.run([sys.executable, "-c", LINES], stderr=output, check=True, timeout=60)
    assert log.read_text().endswith("GET /api/v1/state 999\nan error\n")
    assert sorted(path.name for path in state.glob("serve.log*")) == ["serve.log", "serve.log.1"]
    assert log.stat().st_size + (state / "serve.log.1").stat().st_size <= 20_100
