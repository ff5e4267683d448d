"""Requests to the routes of instances: their form, and the answers to malformed ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient
from tests.unit.serve.conftest import Remember

pytestmark = pytest.mark.usefixtures("begun")
URL = "/api/v1/instances"


@pytest.mark.parametrize(
    ("wish", "key"),
    [
        ({}, "component"),
        ({"component": "throws", "simulations": 257}, "simulations"),
        ({"component": "throws", "image": "ubuntu"}, "image"),
        ({"component": "throws", "set": {"trials": {"image": "ubuntu"}}, "mounts": ["/:/host"]}, "mounts"),
    ],
)
def test_a_wrong_key_of_a_body_begins_nothing_and_is_named(
    client: TestClient, begun: list[dict[str, Any]], wish: Any, key: str
) -> None:
    answer = client.put(f"{URL}/a", json=wish)
    assert answer.headers["content-type"] == "application/problem+json"
    assert (answer.status_code, [each["key"] for each in answer.json()["problems"]]) == (422, [key])
    assert not begun


@pytest.mark.parametrize(("content", "kind"), [(b"{", "json"), (b"\xff", "json"), (b"{}", "text")])
def test_a_body_that_is_no_json_begins_nothing(
    client: TestClient, begun: list[dict[str, Any]], content: bytes, kind: str
) -> None:
    answer = client.put(f"{URL}/a", content=content, headers={"Content-Type": f"application/{kind}"})
    assert answer.status_code in (400, 422)
    assert not begun


@pytest.mark.parametrize("name", ["-rf", "A", "a.b", "a b", "ä", 64 * "a", "a%0A", "%00", "..%2fa", ".."])
def test_a_malformed_id_begins_no_instance(client: TestClient, begun: list[dict[str, Any]], name: str) -> None:
    assert client.put(f"{URL}/{name}", json={"component": "throws"}).status_code in (404, 405, 422)
    assert not begun
    assert client.get(f"{URL}/{name}").status_code == 404
    assert client.get(f"{URL}/{name}/events").status_code == 404


def test_an_unknown_component_is_not_found(client: TestClient) -> None:
    answer = client.put(f"{URL}/a", json={"component": "nothing"})
    assert (answer.status_code, answer.json()["title"]) == (404, "no component 'nothing'; known: throws and talos")


def test_a_request_without_an_id_gets_one(client: TestClient) -> None:
    answer = client.post(URL, json={"component": "throws"})
    assert answer.status_code == 202
    assert answer.headers["location"] == f"{URL}/{answer.json()['id']}"
    assert client.get(answer.headers["location"]).status_code == 200


def test_logs_and_events_of_an_instance_can_be_read(client: TestClient, remember: Remember, tmp_path: Path) -> None:
    remember("a")
    assert client.get(f"{URL}/a/log/sim_0").status_code == 404
    assert client.get(f"{URL}/a/events").content == b""
    logs = tmp_path / "datasets" / "a" / "logs"
    logs.mkdir(parents=True)
    (logs / "sim_0.log").write_bytes(b"".join(b"line %d\xff\n" % number for number in range(500)))
    event = '{"time": "", "run": "a", "event": "started"}\n'
    (logs / "events.jsonl").write_text(event.replace('"a"', '"earlier"') + event)
    (tmp_path / "secret.log").write_text("secret")
    (logs / "leak.log").symlink_to(tmp_path / "secret.log")
    assert client.get(f"{URL}/a/log/sim_0?tail=2").text == "line 498\ufffd\nline 499\ufffd\n"
    assert len(client.get(f"{URL}/a/log/sim_0").text.splitlines()) == 200
    assert client.get(f"{URL}/a/events").text == event
    for node in ("leak", "..%2f..%2f..%2fsecret", "../secret", "sim_1", "%00", 300 * "a"):
        answer = client.get(f"{URL}/a/log/{node}")
        assert answer.status_code == 404, node
        assert "secret\n" not in answer.text
    for tail in ("0", "10001", "x"):
        assert client.get(f"{URL}/a/log/sim_0?tail={tail}").status_code == 422


def test_a_component_lists_the_keys_that_a_request_may_set(client: TestClient) -> None:
    found = {each["key"]: each for each in client.get("/api/v1/components/throws/keys").json()}
    assert found["trials"]["value"] == 3
    assert found["ball.mass_kg"]["takes"] == "number > 0, ≤ 2 kg"
    assert not [key for key in found if key.startswith(("run.", "containers."))]
    assert client.get("/api/v1/components/nothing/keys").status_code == 404
