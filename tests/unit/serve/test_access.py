"""Access to the server by tokens, codes, origins and names of hosts: one test for each way in."""

import logging
import stat
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.testclient import TestClient, WebSocketDenialResponse
from starlette.websockets import WebSocketDisconnect
from tests.unit.serve.conftest import HOST, Served

from throwcollect.errors import ConfigError
from throwcollect.serve import access
from throwcollect.serve.access import Keys

STATE = "/api/v1/state"


def problem_of(answer: Any, status: int) -> str:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["status"] == status
    return str(answer.json()["title"])


@pytest.mark.parametrize("token", ["", "wrong", "wröng"])
def test_requests_without_a_valid_token_are_refused(served: Served, token: str) -> None:
    client = served.client("")
    headers = {"Authorization": f"Bearer {token}".encode("latin-1")} if token else {}
    for path in (STATE, "/api/v1/instances", "/openapi.json", "/api/v1/nothing", "/%61pi/v1/state"):
        answer = client.get(path, headers=headers)
        assert "token" in problem_of(answer, 401)
        assert answer.headers["www-authenticate"] == "Bearer"


def test_a_token_in_the_address_is_accepted_only_for_sockets(served: Served) -> None:
    client = served.client("")
    assert client.get(f"{STATE}?token={served.keys.full}").status_code == 401
    with served.socket(f"{STATE}?token={served.keys.full}") as socket:
        assert socket.receive_json()["version"] == 1


def test_the_page_and_the_health_route_need_no_token(served: Served) -> None:
    client = served.client("")
    assert client.get("/api/v1/health").json()["status"] == "ok"
    assert "html" in client.get("/").headers["content-type"]
    for path in ("/../access.py", "/%2e%2e/access.py", "/..%2faccess.py", "/nothing", "/%00", "/" + 300 * "a"):
        assert client.get(path).status_code == 404, path


def test_every_answer_has_restrictive_security_headers(served: Served) -> None:
    for answer in (served.client().get("/"), served.client().get(STATE), served.client("").get(STATE)):
        assert "default-src 'self'" in answer.headers["content-security-policy"]
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert not [name for name in answer.headers if name.startswith("access-control") or name == "set-cookie"]


def test_the_policy_lets_the_page_connect_only_to_this_server(served: Served) -> None:
    def connections(**headers: str) -> str:
        policy = served.client("").get("/", headers=headers).headers["content-security-policy"]
        return next(rule for rule in policy.split("; ") if rule.startswith("connect-src"))

    assert connections() == f"connect-src 'self' ws://{HOST} wss://{HOST}"
    # The policy does not repeat an unknown name of a host.
    assert connections(Host="evil.example; script-src *") == "connect-src 'self'"


def test_a_read_only_token_cannot_change_anything(served: Served) -> None:
    client = served.client(served.keys.read_only)
    assert client.get(STATE).status_code == 200
    for method, path, content in (
        ("PUT", "instances/a", {"component": "throws"}),
        ("POST", "instances", {"component": "throws"}),
        ("PATCH", "instances/a", {"simulations": 1}),
        ("DELETE", "instances/a", None),
        ("POST", "collections/a/resume", None),
        ("POST", "codes", None),
    ):
        answer = client.request(method, f"/api/v1/{path}", json=content)
        assert problem_of(answer, 403) == "this token may only look"


def test_a_read_only_token_cannot_slow_down_a_simulation(served: Served) -> None:
    path = "/api/v1/instances/a/live/sim_0"
    with served.socket(path, served.keys.read_only) as socket, pytest.raises(WebSocketDisconnect) as end:
        socket.receive_text()
    assert (end.value.code, end.value.reason) == (4403, "this token may only look")


def test_requests_from_pages_of_other_origins_are_refused(served: Served) -> None:
    client = served.client()
    for origin in ("http://evil.example", "null", f"http://{HOST}.evil.example", "http://127.0.0.1"):
        for path in (STATE, "/", "/api/v1/health", "/api/v1/exchange"):
            assert "origin" in problem_of(client.get(path, headers={"Origin": origin}), 403)


def test_requests_with_a_foreign_host_name_are_refused(served: Served) -> None:
    client = served.client()
    for host in ("evil.example", "evil.example:8080", "127.0.0.1", "127.0.0.1:80", ""):
        for path in (STATE, "/", "/api/v1/health"):
            assert "name" in problem_of(client.get(path, headers={"Host": host}), 421)


def parts(size: int) -> Iterator[bytes]:
    """A body in pieces, whose length no header tells."""
    for _ in range(size // 1000):
        yield 1000 * b" "


@pytest.mark.parametrize("path", ["/api/v1/instances", "/api/v1/exchange"])
@pytest.mark.parametrize("with_length", [True, False])
def test_a_body_that_is_too_long_is_refused(served: Served, path: str, with_length: bool) -> None:
    content = 1_001_000 * b" " if with_length else parts(1_001_000)
    answer = served.client().post(path, content=content, headers={"Content-Type": "application/json"})
    assert problem_of(answer, 413) == "a body may have at most 1000000 bytes"


def test_a_socket_without_a_token_is_not_opened(served: Served) -> None:
    for path in (STATE, "/api/v1/instances/a/shown", "/api/v1/instances/a/live/sim_0", "/nothing", "/"):
        for query in ("", "?token=wrong", "?token="):
            with pytest.raises(WebSocketDenialResponse) as refused, served.socket(path + query):
                pass
            assert refused.value.status_code == 401


@pytest.mark.parametrize(("headers", "status"), [({"Origin": "http://evil.example"}, 403), ({"Host": "evil"}, 421)])
def test_a_socket_with_a_foreign_origin_or_host_is_refused(
    served: Served, headers: dict[str, str], status: int
) -> None:
    with (
        pytest.raises(WebSocketDenialResponse) as refused,
        served.socket(STATE, served.keys.full, headers=headers),
    ):
        pass
    assert refused.value.status_code == status


@pytest.mark.parametrize("way", ["header", "subprotocol", "query"])
def test_a_socket_with_a_token_is_opened(served: Served, way: str) -> None:
    token = served.keys.read_only
    protocols = ["other", f"bearer.{token}"] if way == "subprotocol" else None
    query = f"?token={token}" if way == "query" else ""
    with served.socket(STATE + query, token if way == "header" else "", subprotocols=protocols) as socket:
        assert socket.receive_json()["revision"] == 1
        # A browser closes the socket if none of its protocols is taken.
        assert socket.accepted_subprotocol == (f"bearer.{token}" if way == "subprotocol" else None)


def exchange(client: TestClient, code: str) -> Any:
    return client.post("/api/v1/exchange", json={"code": code})


def test_a_code_can_be_exchanged_only_once(served: Served) -> None:
    code = served.client().post("/api/v1/codes").json()["code"]
    anybody = served.client("")
    assert exchange(anybody, code).json() == {"token": served.keys.full}
    assert "exchanged already" in problem_of(exchange(anybody, code), 403)
    assert exchange(anybody, "guessed").status_code == 403


def test_a_code_lasts_ten_minutes(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr(access, "time", SimpleNamespace(monotonic=lambda: now))
    keys = Keys()
    late, early = keys.new_code(), keys.new_code()
    now += 599
    assert keys.exchange(early) == keys.full
    now += 2
    assert keys.exchange(late) is None


def test_the_log_line_of_a_request_has_no_query_and_no_token(served: Served, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "throwcollect.serve")
    full, read_only = served.keys.full, served.keys.read_only
    served.client().get("/api/v1/health?token=abc")
    served.client().get(STATE)
    served.client(read_only).post("/api/v1/codes")
    served.client("").get(STATE)
    with served.socket(f"{STATE}?token={read_only}"):
        # The line is written when a socket opens, as it may stay open for days.
        assert caplog.messages[-1] == "SOCKET /api/v1/state 101 read-only"
    with pytest.raises(WebSocketDenialResponse), served.socket(f"{STATE}?token=guessed"):
        pass
    served.client().get("/api/v1/a%0AGET%20/api/v1/forged%20200%20full")
    assert caplog.messages == [
        "GET /api/v1/health 200 unknown",
        "GET /api/v1/state 200 full",
        "POST /api/v1/codes 403 read-only",
        "GET /api/v1/state 401 unknown",
        "SOCKET /api/v1/state 101 read-only",
        "SOCKET /api/v1/state 401 unknown",
        "GET /api/v1/a%0AGET%20/api/v1/forged%20200%20full 404 full",
    ]
    assert not [line for line in caplog.messages if full in line or read_only in line]


def test_an_unexpected_error_gives_a_log_line_and_a_problem_response(
    served: Served, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.INFO, "throwcollect.serve")

    def fail(*_: object) -> None:
        raise RuntimeError("secret")

    monkeypatch.setattr("throwcollect.serve.instance_routes.describe", fail)
    monkeypatch.setattr(type(served.instances), "get", fail)
    answer = served.client(fails=False).get("/api/v1/instances/a")
    assert problem_of(answer, 500) == "internal error"
    assert "secret" not in answer.text
    assert caplog.messages[0] == "GET /api/v1/instances/a 500 full"


def test_tokens_of_a_file_outlive_the_server(tmp_path: Path) -> None:
    path = tmp_path / "tokens"
    first = Keys.of_file(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    again = Keys.of_file(path)
    assert (again.full, again.read_only) == (first.full, first.read_only)
    assert first.full != first.read_only


@pytest.mark.parametrize(
    ("text", "mode", "reason"),
    [
        (f"{'a' * 20}\n{'b' * 20}\n", 0o644, "others can read it"),
        (f"{'a' * 20}\n", 0o600, "should have two tokens"),
        (f"{'a' * 20}\n{'a' * 20}\n", 0o600, "should have two tokens"),
        (f"{'a' * 20}\nshort\n", 0o600, "should have two tokens"),
    ],
)
def test_a_token_file_that_cannot_keep_others_out_is_rejected(
    tmp_path: Path, text: str, mode: int, reason: str
) -> None:
    path = tmp_path / "tokens"
    path.write_text(text)
    path.chmod(mode)
    with pytest.raises(ConfigError, match=reason):
        Keys.of_file(path)
