"""Find the server of this user, start one in the background, end it, and get an address of its page."""

from __future__ import annotations

import fcntl
import http.client
import json
import os
import select
import signal
import ssl
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.request import HTTPSHandler, ProxyHandler, Request, build_opener

from pydantic import TypeAdapter

from throwcollect.errors import WorkerError
from throwcollect.files import open_log, write_file
from throwcollect.own_process import make_command
from throwcollect.state_directory import is_locked, state_directory

_FILE = "serve.json"
_LOCK = "serve.lock"
_LOG = "serve.log"
SERVER = "server"
"""What commands that list and end runs call the server."""
_START_S = 20.0
_END_S = 5.0
"""A server needs less to end."""
_ANSWER_S = 5.0
_POLL_S = 0.05
_LOCK_S = 0.5


@dataclass(frozen=True)
class Address:
    """How programs of the same user reach a server.

    Attributes:
        url: Scheme, host and port.
        token: Token that may do everything.
        read_only_token: Token that may only look.
        pid: Process id of the server.
        certificate: Path of the server's certificate; None if it has no TLS.
    """

    url: str
    token: str
    read_only_token: str
    pid: int
    certificate: str | None = None

    def page(self, code: str, run: str | None = None) -> str:
        """Address of the page, on one run or all; the one-time code is in the fragment, which browsers never send."""
        return f"{self.url}/#code={code}" + (f"&run={run}" if run else "")


@contextmanager
def publish(address: Address) -> Iterator[None]:
    """Let programs of this user find this server as long as the block lasts.

    If there is another server already, programs find that one.
    """
    path = _find_path()
    lock = os.open(path.with_name(_LOCK), os.O_RDWR | os.O_CREAT, 0o600)
    is_first = False
    # A server holds the lock until it ends, even if it is killed. `is_locked` of a program holds it for a moment.
    deadline = time.monotonic() + _LOCK_S
    while not is_first and time.monotonic() < deadline:
        with suppress(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            is_first = True
        time.sleep(0 if is_first else _POLL_S)
    if is_first:
        write_file(path, _ADDRESS.dump_json(address), mode=0o600)
    try:
        yield
    finally:
        if is_first:
            path.unlink(missing_ok=True)
        os.close(lock)


def find_server() -> Address | None:
    """Find the server of this user, even one that does not answer; returns None if none lives."""
    # If a server was killed, another process may have got its port or pid. Only the lock proves that a server lives.
    with suppress(OSError, ValueError):
        if is_locked(_find_path().with_name(_LOCK)):
            return _ADDRESS.validate_json(_find_path().read_bytes())
    return None


def end_server() -> Address | None:
    """End the server of this user, by force if it does not end on its own; returns None if none lives."""
    if (address := find_server()) is None:
        return None
    with suppress(ProcessLookupError):
        # If the server lives after this, the descriptor is that of its process, and of no later one with the same id.
        process = os.pidfd_open(address.pid)
        try:
            for number in (signal.SIGTERM, signal.SIGKILL):
                if find_server() == address:
                    signal.pidfd_send_signal(process, number)
                    select.select([process], [], [], _END_S)
        finally:
            os.close(process)
    return address


def ensure_server() -> Address:
    """Find the server of this user; if none lives, start one, which outlives this process."""
    if (address := find_server()) is not None:
        return address
    log = state_directory() / _LOG
    words = [*make_command(), "serve", "--json"]
    with open(open_log(log), "ab") as output:
        # Standard output has a one-time code. It does not go to the log, which the user may let others read.
        process = subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=output, start_new_session=True
        )
    deadline = time.monotonic() + _START_S
    while time.monotonic() < deadline and process.poll() is None:
        if (address := find_server()) is not None:
            if address.pid != process.pid:
                # Another process has started a server at the same time, and that one was faster.
                process.terminate()
            return address
        time.sleep(_POLL_S)
    process.terminate()
    raise WorkerError(f"no server starts; {log} has the reason")


def make_page_address(address: Address, run: str | None = None) -> str:
    """Make an address of the page, on one run or all, that can be opened once, within ten minutes."""
    context = None
    if address.certificate is not None:
        # Only this one certificate is accepted, so the names in it and its issuer do not matter.
        context = ssl.create_default_context(cafile=address.certificate)
        context.check_hostname = False
        context.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    # A proxy of the environment must not be asked for a server of this machine.
    opener = build_opener(ProxyHandler({}), HTTPSHandler(context=context))
    headers = {"Authorization": f"Bearer {address.token}"}
    try:
        request = Request(f"{address.url}/api/v1/codes", method="POST", headers=headers)  # noqa: S310 - a server wrote it
        with opener.open(request, timeout=_ANSWER_S) as answer:
            return address.page(json.loads(answer.read())["code"], run)
    except (OSError, ValueError, KeyError, http.client.HTTPException) as error:
        raise WorkerError(f"{address.url}: the server does not answer: {error}") from error


_ADDRESS = TypeAdapter(Address)


def _find_path() -> Path:
    return state_directory() / _FILE
