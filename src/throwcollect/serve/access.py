"""Who may do what: the token, the Host and the Origin of every request and every socket, and how much a body may hold.

A page that somebody else serves can neither read nor do anything here: browsers tell whose page asks (Origin), a name
that was turned to this address is not ours (Host), and there are no cookies.
"""

from __future__ import annotations

import hmac
import logging
import secrets
import time
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs

from throwcollect.serve.problems import problem

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

_MOST_BODY = 1_000_000
"""Bytes of a request's body."""
_CODE_S = 600.0
"""Time for which a one-time code can be exchanged."""
_SUBPROTOCOL = "bearer."
_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; connect-src 'self' ws: wss:; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = (
    (b"content-security-policy", _POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
)
_AUDIT = logging.getLogger("throwcollect.serve")


@dataclass
class Keys:
    """What lets somebody in.

    Attributes:
        full: Token of those who may do everything.
        read_only: Token of those who may only look.
    """

    full: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    read_only: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    _codes: dict[str, float] = field(default_factory=dict)

    def may_change(self, token: str) -> bool | None:
        """Whether whoever has a token may change anything; None if nobody has that token."""
        given = token.encode()
        full = hmac.compare_digest(given, self.full.encode())
        read_only = hmac.compare_digest(given, self.read_only.encode())
        return full if full or read_only else None

    def new_code(self) -> str:
        """A code that can be exchanged for the full token once, within ten minutes: what an address may hold."""
        now = time.monotonic()
        self._codes = {code: until for code, until in self._codes.items() if until > now}
        code = secrets.token_urlsafe(16)
        self._codes[code] = now + _CODE_S
        return code

    def exchange(self, code: str) -> str | None:
        """The full token for a code that nobody has exchanged yet; None for any other."""
        until = self._codes.pop(code, None)
        return self.full if until is not None and until > time.monotonic() else None


class Access:
    """Lets requests and sockets through to an application that may pass.

    Args:
        app: The application.
        keys: What lets somebody in.
        hosts: Values of the header Host that are ours, with ports.
        origins: Origins of pages that may connect, besides our own.
    """

    def __init__(self, app: Any, keys: Keys, hosts: frozenset[str], origins: frozenset[str] = frozenset()) -> None:
        self._app = app
        self._keys = keys
        self._hosts = hosts
        self._origins = origins | {f"{scheme}://{host}" for scheme in ("http", "https") for host in hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Take a request or a socket, as ASGI has it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        refusal, may_change = self._judge(scope, headers)
        scope.setdefault("state", {})["may_change"] = may_change
        answer = _Answer(scope, send)
        if refusal is not None:
            status, title = refusal
            await _refuse(scope, receive, answer, status, title)
        elif scope["type"] == "http":
            await self._app(scope, _limit(receive), answer)
        else:
            await self._app(scope, receive, answer)
        _AUDIT.info("%s %s %s %s", *answer.described, "full" if may_change else "read-only")

    def _judge(self, scope: Scope, headers: dict[str, str]) -> tuple[tuple[int, str] | None, bool]:
        """Why somebody is refused, as status and sentence, None if not; and whether they may change anything."""
        if headers.get("host", "") not in self._hosts:
            return (421, "this server is not known by that name"), False
        if "origin" in headers and headers["origin"] not in self._origins:
            return (403, "pages of another origin may not connect"), False
        if scope["type"] == "http" and _is_public(scope["path"]):
            return None, False
        may_change = self._keys.may_change(_token(scope, headers))
        if may_change is None:
            return (401, "a token is missing, or it is not ours"), False
        if not may_change and scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
            return (403, "this token may only look"), False
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length) > _MOST_BODY:
            return (413, f"a body may have {_MOST_BODY} bytes"), may_change
        return None, may_change


def _is_public(path: str) -> bool:
    """Whether anybody may have what is at a path: the page and its parts, which hold nothing of a user."""
    return path in ("/api/v1/health", "/api/v1/exchange") or not path.startswith(("/api/", "/openapi.json"))


def _token(scope: Scope, headers: dict[str, str]) -> str:
    """The token that somebody shows; empty if none."""
    scheme, _, given = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        return given.strip()
    if scope["type"] != "websocket":
        return ""
    for protocol in scope.get("subprotocols", ()):
        if protocol.startswith(_SUBPROTOCOL):
            return str(protocol).removeprefix(_SUBPROTOCOL)
    # Clients of rosbridge have no other way to show it.
    return str(parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0])


def _limit(receive: Receive) -> Receive:
    """What receives a body, and breaks off if that is too long, whatever its header says."""
    left = _MOST_BODY

    async def receive_some() -> MutableMapping[str, Any]:
        nonlocal left
        message = await receive()
        left -= len(message.get("body", b""))
        return message if left >= 0 else {"type": "http.disconnect"}

    return receive_some


async def _refuse(scope: Scope, receive: Receive, send: Any, status: int, title: str) -> None:
    headers = {"WWW-Authenticate": "Bearer"} if status == HTTPStatus.UNAUTHORIZED else None
    response = problem(status, title, headers=headers)
    if scope["type"] == "http":
        await response(scope, receive, send)
    elif "websocket.http.response" in scope.get("extensions", {}):
        start = {"status": status, "headers": response.raw_headers}
        await send({"type": "websocket.http.response.start", **start})
        await send({"type": "websocket.http.response.body", "body": response.body})
    else:
        await send({"type": "websocket.close", "code": 1008, "reason": title})


class _Answer:
    """Sends what an application answers, with the headers that all answers have, and notes the status."""

    def __init__(self, scope: Scope, send: Send) -> None:
        self._send = send
        self._scope = scope
        self._status = 0
        self._protocol = next((p for p in scope.get("subprotocols", ()) if p.startswith(_SUBPROTOCOL)), None)

    async def __call__(self, message: MutableMapping[str, Any]) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            self._status = message["status"]
            message = {**message, "headers": [*message.get("headers", ()), *_HEADERS]}
        elif message["type"] == "websocket.accept":
            self._status = int(HTTPStatus.SWITCHING_PROTOCOLS)
            # A browser closes the socket if none of its protocols is taken.
            message = {**message, "subprotocol": message.get("subprotocol") or self._protocol}
        elif message["type"] == "websocket.close" and not self._status:
            self._status = int(HTTPStatus.FORBIDDEN)
        await self._send(message)

    @property
    def described(self) -> tuple[str, str, int]:
        """Method, path without what follows it, which may hold a token, and status."""
        return self._scope.get("method", "SOCKET"), self._scope["path"], self._status
