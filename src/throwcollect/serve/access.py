"""Checks of every request and every socket: the token, the headers Host and Origin, and the size of the body.

So the page of another site can neither read nor do anything here. The browser sends that site's Origin. If a foreign
name leads to this address (DNS rebinding), that name stands in Host. And there are no cookies, which a browser would
send with every request.
"""

from __future__ import annotations

import hmac
import logging
import re
import secrets
import time
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Literal
from urllib.parse import parse_qs, quote

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from throwcollect.errors import ConfigError
from throwcollect.files import write_file
from throwcollect.serve.problem_responses import make_problem

_MOST_BODY = 1_000_000
"""Bytes of a request's body."""
MAY_ONLY_LOOK = 403, "this token may only look"
"""Status and sentence for a request to change something with the token that may only look."""
_PLAIN = "/-_.~{}:@!$&'()*+,;="
_CODE_S = 600.0
"""Time for which a one-time code can be exchanged."""
_FORM = r"[A-Za-z0-9_-]{16,}"
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


Rights = Literal["full", "read-only", "unknown"]
"""What a client may do, as the log names it: everything, looking, or nothing."""


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

    @classmethod
    def of_file(cls, path: Path) -> Keys:
        """Take the tokens from a file, with the full one in the first line, so that they outlive a restart.

        A file that does not exist is made, with new tokens.
        """
        if not path.exists():
            keys = cls()
            write_file(path, f"{keys.full}\n{keys.read_only}\n".encode(), mode=0o600)
        tokens = path.read_text(errors="replace").split()
        if path.stat().st_mode & 0o077:
            raise ConfigError(f"--token-file {path}: others can read it", hint=f"chmod 600 {path}")
        if len(set(tokens)) != 2 or not all(re.fullmatch(_FORM, each) for each in tokens):
            raise ConfigError(
                f"--token-file {path}: should have two tokens of 16 or more letters, digits, - and _, in two lines",
                expected="the token that may do everything, then the one that may only look",
            )
        return cls(tokens[0], tokens[1])

    def rights_of(self, token: str) -> Rights:
        """What the owner of a token may do; nothing if it is no token of this server."""
        # Both comparisons are always made, and take the same time for any token, so that the time reveals nothing.
        given = token.encode()
        full = hmac.compare_digest(given, self.full.encode())
        read_only = hmac.compare_digest(given, self.read_only.encode())
        return "full" if full else "read-only" if read_only else "unknown"

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

    # Middleware of Starlette would not do: TrustedHostMiddleware knows neither ports nor IPv6, and CORSMiddleware lets
    # requests of other origins through.
    def __init__(self, app: ASGIApp, keys: Keys, hosts: frozenset[str], origins: frozenset[str] = frozenset()) -> None:
        self._app = app
        self._keys = keys
        self._hosts = hosts
        self._origins = origins | {f"{scheme}://{host}" for scheme in ("http", "https") for host in hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request or a socket, as ASGI defines it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        refusal, rights = self._judge(scope, headers)
        scope.setdefault("state", {})["may_change"] = rights == "full"
        host = headers.get("host", "")
        send = _add_headers(scope, send, rights, host if host in self._hosts else None)
        if refusal is None:
            await self._app(scope, _limit_body(receive), send)
        else:
            status, title = refusal
            more = {"WWW-Authenticate": "Bearer"} if status == HTTPStatus.UNAUTHORIZED else None
            # For a socket, this refuses the handshake with a status and a body.
            await make_problem(status, title, headers=more)(scope, receive, send)

    def _judge(self, scope: Scope, headers: Headers) -> tuple[tuple[int, str] | None, Rights]:
        """Decide on a request.

        Returns:
            Status and sentence of a refusal, or None; and what the client may do.
        """
        # Host and Origin come first: a foreign page must not even learn whether a token is right.
        if headers.get("host", "") not in self._hosts:
            return (421, "this server is not known by that name"), "unknown"
        if "origin" in headers and headers["origin"] not in self._origins:
            return (403, "pages of another origin may not connect"), "unknown"
        # The page itself needs no token, because it holds no secret: it exchanges the code in the printed address.
        if scope["type"] == "http" and _is_public(scope["path"]):
            return None, "unknown"
        rights = self._keys.rights_of(_read_token(scope, headers))
        if rights == "unknown":
            return (401, "a token is missing, or it is not ours"), rights
        if rights == "read-only" and scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
            return MAY_ONLY_LOOK, rights
        return None, rights


def _is_public(path: str) -> bool:
    """Whether a path needs no token: health, the exchange of codes, and the page, which has no data of users."""
    return path in ("/api/v1/health", "/api/v1/exchange") or not path.startswith(("/api/", "/openapi.json"))


def _read_token(scope: Scope, headers: Headers) -> str:
    """The token of a request; empty if it has none."""
    scheme, _, given = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        return given.strip()
    if scope["type"] != "websocket":
        return ""
    if (protocol := _find_protocol(scope)) is not None:
        return protocol.removeprefix(_SUBPROTOCOL)
    # Clients of rosbridge can set neither headers nor subprotocols, so they give the token in the query.
    return str(parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0])


def _find_protocol(scope: Scope) -> str | None:
    return next((str(each) for each in scope.get("subprotocols", ()) if each.startswith(_SUBPROTOCOL)), None)


def _limit_body(receive: Receive) -> Receive:
    """Make a function that receives as ``receive`` does, and raises an error when a body gets too long."""
    left = _MOST_BODY

    async def receive_some() -> Message:
        nonlocal left
        message = await receive()
        left -= len(message.get("body", b""))
        if left < 0:
            raise HTTPException(413, f"a body may have at most {_MOST_BODY} bytes")
        return message

    return receive_some


def _add_headers(scope: Scope, send: Send, rights: Rights, host: str | None) -> Send:
    """Make a function that sends as ``send`` does, with the headers that all answers have, and a line in the log.

    The policy lets the page connect to this server only; without a ``host``, the page gets no sockets.
    """
    # The sockets have to be named because in some browsers 'self' does not include them.
    policy = _POLICY.format(sockets=f" ws://{host} wss://{host}" if host else "").encode()
    is_noted = False

    def note(status: int) -> None:
        nonlocal is_noted
        if not is_noted:
            # The query is left out, because it may hold a token. The path is quoted, so that it cannot forge a line.
            path = quote(scope["path"], safe=_PLAIN)
            _AUDIT.info("%s %s %d %s", scope.get("method", "SOCKET"), path, status, rights)
        is_noted = True

    async def send_more(message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            note(message["status"])
            more = (*_HEADERS, (b"content-security-policy", policy))
            message = {**message, "headers": [*message.get("headers", ()), *more]}
        elif message["type"] == "websocket.accept":
            note(HTTPStatus.SWITCHING_PROTOCOLS)
            # A browser closes the socket if the server accepts none of the protocols that the browser offers.
            message = {**message, "subprotocol": message.get("subprotocol") or _find_protocol(scope)}
        elif message["type"] == "websocket.close":
            note(HTTPStatus.FORBIDDEN)
        await send(message)

    return send_more
