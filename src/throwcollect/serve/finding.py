"""How programs of the same user find the server that lives, start one in the background, and get an address to open."""

from __future__ import annotations

import fcntl
import http.client
import json
import os
import ssl
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from urllib.parse import urlsplit

from pydantic import TypeAdapter

from throwcollect.errors import DatasetError, WorkerError
from throwcollect.files import open_log, write_secret
from throwcollect.runs.state_directory import is_locked, state_directory

_FILE = "serve.json"
_LOCK = "serve.lock"
_LOG = "serve.log"
_START_S = 20.0
_ANSWER_S = 5.0
_POLL_S = 0.05


@dataclass(frozen=True)
class Address:
    """Where somebody serves, for programs of the same user.

    Attributes:
        url: Where, without a path.
        token: Lets its owner do everything.
        read_only_token: Lets its owner look.
        pid: Process id.
        certificate: Path of the certificate that it shows; None if it speaks in the clear.
    """

    url: str
    token: str
    read_only_token: str
    pid: int
    certificate: str | None = None

    def page(self, code: str, run: str | None = None) -> str:
        """The address of the page, with a one-time code in the part that is never sent.

        Args:
            code: The code.
            run: Id of the run that the page is to show; None for all.
        """
        return f"{self.url}/#code={code}" + (f"&run={run}" if run else "")


@contextmanager
def publish(address: Address) -> Iterator[None]:
    """Have programs of this user find this process, as long as the block lasts.

    If another server is to be found already, this one is as soon as that has ended.

    Args:
        address: Where this process serves.

    Raises:
        DatasetError: If the file cannot be written.
        WorkerError: If its lock cannot be had.
        ConfigError: If runs cannot be remembered.
    """
    path = _path()
    try:
        lock = os.open(path.with_name(_LOCK), os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise WorkerError(f"{path}: nobody would find this server: {error.strerror}") from error
    turn, has_left = threading.Lock(), threading.Event()

    def wait() -> None:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with turn:
            if has_left.is_set():
                os.close(lock)
                return
            # The disk may be full by now; this server can do without.
            with suppress(DatasetError):
                write_secret(path, _ADDRESS.dump_json(address))

    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        # The lock goes with the process that has it, however that ends.
        threading.Thread(target=wait, name="next to be found", daemon=True).start()
    else:
        write_secret(path, _ADDRESS.dump_json(address))
    try:
        yield
    finally:
        with turn:
            has_left.set()
            if _read() == address:
                path.unlink(missing_ok=True)
                os.close(lock)


def log_path() -> Path:
    """File of what a server prints that was started in the background.

    Raises:
        ConfigError: If runs cannot be remembered.
    """
    return state_directory() / _LOG


def find_server() -> Address | None:
    """Where somebody of this user serves by now; None if nobody answers.

    Raises:
        ConfigError: If runs cannot be remembered.
    """
    address = _read()
    # Nobody else's process, which may have got its port or its pid since, has the lock.
    if address is None or not _is_locked():
        return None
    try:
        _ask(address, "GET", "/api/v1/health")
    except (OSError, ValueError, http.client.HTTPException):
        return None
    return address


def ensure_server() -> Address:
    """Where somebody of this user serves; if nobody does, a server is started, which outlives this process.

    Raises:
        WorkerError: If it does not start.
        ConfigError: If runs cannot be remembered.
    """
    if (address := find_server()) is not None:
        return address
    log = log_path()
    words = [sys.executable, "-m", "throwcollect", "serve", "--json"]
    with open(open_log(log), "ab") as output:
        # What it prints has a code, and others may be allowed to read the log.
        process = subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=output, start_new_session=True
        )
    deadline = time.monotonic() + _START_S
    while time.monotonic() < deadline and process.poll() is None:
        if (address := find_server()) is not None:
            if address.pid != process.pid:
                # Somebody else was faster.
                process.terminate()
            return address
        time.sleep(_POLL_S)
    process.terminate()
    said = ""
    with suppress(OSError):
        said = "\n".join(log.read_text(errors="replace").splitlines()[-5:])
    raise WorkerError("no server starts", evidence=said or None, hint="throwcollect serve tells more")


def make_page_address(address: Address, run: str | None = None) -> str:
    """An address of the page that can be opened once, within ten minutes.

    Args:
        address: Where somebody serves.
        run: Id of the run that the page is to show; None for all.

    Raises:
        WorkerError: If the server does not answer.
    """
    try:
        return address.page(_ask(address, "POST", "/api/v1/codes")["code"], run)
    except (OSError, ValueError, KeyError, http.client.HTTPException) as error:
        raise WorkerError(f"{address.url}: the server does not answer: {error}") from error


def _ask(address: Address, method: str, path: str) -> dict[str, str]:
    parts = urlsplit(address.url)
    host, port = parts.hostname or "", parts.port
    if address.certificate is None:
        connection = http.client.HTTPConnection(host, port, timeout=_ANSWER_S)
    else:
        # It is the very certificate that is expected, whatever names it was made for.
        context = ssl.create_default_context(cafile=address.certificate)
        context.check_hostname = False
        # Whoever has signed it need not be known here.
        context.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
        connection = http.client.HTTPSConnection(host, port, timeout=_ANSWER_S, context=context)
    with closing(connection):
        connection.request(method, path, headers={"Authorization": f"Bearer {address.token}"})
        answer = connection.getresponse()
        content = json.loads(answer.read())
    if answer.status >= HTTPStatus.BAD_REQUEST or not isinstance(content, dict):
        raise ValueError(f"{path}: status {answer.status}")
    return content


_ADDRESS = TypeAdapter(Address)


def _path() -> Path:
    return state_directory() / _FILE


def _is_locked() -> bool:
    """Whether a server lives that is to be found."""
    return is_locked(_path().with_name(_LOCK))


def _read() -> Address | None:
    try:
        return _ADDRESS.validate_json(_path().read_bytes())
    except (OSError, ValueError):
        return None
