"""Checks of every request and every socket: the token, the headers Host and Origin, and the size of the body.

So the page of another site can neither read nor do anything here. The browser sends that site's Origin. If somebody has
pointed a foreign name at this address (DNS rebinding), that name stands in Host. And there are no cookies, which a
browser would send by itself.
"""

from __future__ import annotations

import hmac
import logging
import secrets
import time
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass, field
from enum import Enum
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs, quote

from throwcollect.serve.problem_responses import problem

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

_MOST_BODY = 1_000_000
"""Bytes of a request's body."""
_TOO_LONG = 413, f"a body may have at most {_MOST_BODY} bytes"
MAY_ONLY_LOOK = 403, "this token may only look"
"""Status and sentence for a request to change something with the token that may only look."""
_PLAIN = "/-_.~{}:@!$&'()*+,;="
_CODE_S = 600.0
"""Time for which a one-time code can be exchanged."""
_SUBPROTOCOL = "bearer."
_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; connect-src 'self'{sockets}; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
)
_AUDIT = logging.getLogger("throwcollect.serve")


class Rights(Enum):
    """What a client may do; the values are the names of the groups of clients in the log."""

    CHANGE = "full"
    LOOK = "read-only"
    NONE = "anybody"


@dataclass
class Keys:
    """The tokens of a server, and one-time codes for the full one.

    Attributes:
        full: Token of clients that may do everything.
        read_only: Token of clients that may only look.
    """

    full: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    read_only: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    _codes: dict[str, float] = field(default_factory=dict)

    def rights_of(self, token: str) -> Rights:
        """What the owner of a token may do; nothing if it is no token of this server."""
        # Both comparisons are always made, and take the same time for any token, so that the time reveals nothing.
        given = token.encode()
        full = hmac.compare_digest(given, self.full.encode())
        read_only = hmac.compare_digest(given, self.read_only.encode())
        if full:
            return Rights.CHANGE
        return Rights.LOOK if read_only else Rights.NONE

    def new_code(self) -> str:
        """Make a code for an address: it can be exchanged for the full token once, within ten minutes."""
        now = time.monotonic()
        self._codes = {code: until for code, until in self._codes.items() if until > now}
        code = secrets.token_urlsafe(16)
        self._codes[code] = now + _CODE_S
        return code

    def exchange(self, code: str) -> str | None:
        """Take a code, and return the full token for it; None if the code is wrong, used or too old."""
        until = self._codes.pop(code, None)
        return self.full if until is not None and until > time.monotonic() else None


class Access:
    """Lets only permitted requests and sockets through to an application.

    The header Host has to be one of ``hosts``, which include ports. Origin has to be one of these, or one of
    ``origins``.
    """

    def __init__(self, app: Any, keys: Keys, hosts: frozenset[str], origins: frozenset[str] = frozenset()) -> None:
        self._app = app
        self._keys = keys
        self._hosts = hosts
        self._origins = origins | {f"{scheme}://{host}" for scheme in ("http", "https") for host in hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request or a socket, as ASGI defines it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        refusal, rights = self._judge(scope, headers)
        scope.setdefault("state", {})["may_change"] = rights is Rights.CHANGE
        host = headers.get("host", "")
        answer = _Answer(scope, send, rights.value, _write_policy(host if host in self._hosts else None))
        if refusal is not None:
            await _refuse(scope, receive, answer, *refusal)
            return
        body = _Body(receive)
        try:
            await self._app(scope, body.receive, body.unless_too_long(answer))
        finally:
            if body.is_too_long:
                await _refuse(scope, receive, answer, *_TOO_LONG)

    def _judge(self, scope: Scope, headers: dict[str, str]) -> tuple[tuple[int, str] | None, Rights]:
        """Decide on a request.

        Returns:
            Status and sentence of a refusal, or None; and what the client may do.
        """
        # Host and Origin come first: a foreign page must not even learn whether a token is right.
        if headers.get("host", "") not in self._hosts:
            return (421, "this server is not known by that name"), Rights.NONE
        if "origin" in headers and headers["origin"] not in self._origins:
            return (403, "pages of another origin may not connect"), Rights.NONE
        length = headers.get("content-length", "0")
        too_long = None if length.isdecimal() and int(length) <= _MOST_BODY else _TOO_LONG
        # The page itself needs no token, because it holds no secret: it exchanges the code in the printed address.
        if scope["type"] == "http" and _is_public(scope["path"]):
            return too_long, Rights.NONE
        rights = self._keys.rights_of(_read_token(scope, headers))
        if rights is Rights.NONE:
            return (401, "a token is missing, or it is not ours"), rights
        if rights is Rights.LOOK and scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
            return MAY_ONLY_LOOK, rights
        return too_long, rights


def _is_public(path: str) -> bool:
    """Whether a path needs no token: health, the exchange of codes, and the page, which has no data of users."""
    return path in ("/api/v1/health", "/api/v1/exchange") or not path.startswith(("/api/", "/openapi.json"))


def _read_token(scope: Scope, headers: dict[str, str]) -> str:
    """The token of a request; empty if it has none."""
    scheme, _, given = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        return given.strip()
    if scope["type"] != "websocket":
        return ""
    for protocol in scope.get("subprotocols", ()):
        if protocol.startswith(_SUBPROTOCOL):
            return str(protocol).removeprefix(_SUBPROTOCOL)
    # Clients of rosbridge can set neither headers nor subprotocols, so they give the token in the query.
    return str(parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0])


class _Body:
    """Receives a body; if it gets too long, whatever its header says, breaks off as if the client had left.

    Attributes:
        is_too_long: Whether the body was too long.
    """

    def __init__(self, receive: Receive) -> None:
        self.is_too_long = False
        self._receive = receive
        self._allowed = _MOST_BODY

    async def receive(self) -> MutableMapping[str, Any]:
        message = await self._receive()
        self._allowed -= len(message.get("body", b""))
        self.is_too_long = self._allowed < 0
        return {"type": "http.disconnect"} if self.is_too_long else message

    def unless_too_long(self, send: Send) -> Send:
        """Make a function that drops the application's answer if the body was too long: the client gets a refusal."""

        async def send_some(message: MutableMapping[str, Any]) -> None:
            if not self.is_too_long:
                await send(message)

        return send_some


async def _refuse(scope: Scope, receive: Receive, send: Any, status: int, title: str) -> None:
    headers = {"WWW-Authenticate": "Bearer"} if status == HTTPStatus.UNAUTHORIZED else None
    response = problem(status, title, headers=headers)
    if scope["type"] == "http":
        await response(scope, receive, send)
    # With this extension of ASGI, a refused handshake gets a status and a body; without it, the status is always 403.
    elif "websocket.http.response" in scope.get("extensions", {}):
        start = {"status": status, "headers": response.raw_headers}
        await send({"type": "websocket.http.response.start", **start})
        await send({"type": "websocket.http.response.body", "body": response.body})
    else:
        await send({"type": "websocket.close", "code": 1008, "reason": title})


def _write_policy(host: str | None) -> bytes:
    """Write the policy that lets the page connect to this server only; if `host` is None, the page gets no sockets."""
    # The sockets have to be named because in some browsers 'self' does not include them.
    return _POLICY.format(sockets=f" ws://{host} wss://{host}" if host else "").encode()


class _Answer:
    """Sends the answer to a request with the headers that all answers have, and writes a line to the log."""

    def __init__(self, scope: Scope, send: Send, group: str, policy: bytes) -> None:
        self._send = send
        self._scope = scope
        self._group = group
        self._headers = (*_HEADERS, (b"content-security-policy", policy))
        self._is_noted = False
        self._protocol = next((p for p in scope.get("subprotocols", ()) if p.startswith(_SUBPROTOCOL)), None)

    async def __call__(self, message: MutableMapping[str, Any]) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            self._note(message["status"])
            message = {**message, "headers": [*message.get("headers", ()), *self._headers]}
        elif message["type"] == "websocket.accept":
            self._note(HTTPStatus.SWITCHING_PROTOCOLS)
            # A browser closes the socket if the server accepts none of the protocols that the browser offers.
            message = {**message, "subprotocol": message.get("subprotocol") or self._protocol}
        elif message["type"] == "websocket.close":
            self._note(HTTPStatus.FORBIDDEN)
        await self._send(message)

    def _note(self, status: int) -> None:
        if self._is_noted:
            return
        self._is_noted = True
        # The query is left out, because it may hold a token. The path is quoted, so that it cannot forge a second line.
        path = quote(self._scope["path"], safe=_PLAIN)
        _AUDIT.info("%s %s %d %s", self._scope.get("method", "SOCKET"), path, status, self._group)
