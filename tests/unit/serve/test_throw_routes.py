"""Routes by which clients get the throws of a dataset: all of them as columns, and each as the page replays it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from starlette.testclient import TestClient
from tests.unit.serve.conftest import Remember, make_end_fields

import throwcollect
from throwcollect.dataset.directory import path_of_part

URL = "/api/v1/collections"


@pytest.fixture
def directory(collected: Path, tmp_path: Path, remember: Remember) -> Path:
    """The dataset of a run that has ended."""
    directory = tmp_path / "datasets" / "a"
    shutil.copytree(collected, directory)
    remember("a", **make_end_fields())
    return directory


def read_header(content: bytes) -> dict[str, object]:
    return dict(json.loads(content[4 : 4 + int.from_bytes(content[:4], "little")]))


def test_the_throws_of_a_finished_dataset_have_places_and_swept_values(client: TestClient, directory: Path) -> None:
    found = client.get(f"{URL}/a/throws").json()
    dataset = throwcollect.load(directory)
    assert (found["trial"], found["outcome"]) == ([0, 1, 2], ["landed"] * 3)
    assert (found["x_m"], found["y_m"]) == tuple(dataset[f"landing_{axis}_m"].tolist() for axis in "xy")
    assert found["values"] == {key: [each.parameters[key] for each in dataset] for key in dataset.plan.keys}
    assert (found["total"], found["counts"], found["is_finished"]) == (3, {"landed": 3}, True)
    assert (found["noun"], found["end"], found["success"]) == ("throw", "landing", "landed")


def test_throws_of_a_growing_dataset_come_in_parts(client: TestClient, directory: Path, remember: Remember) -> None:
    """A growing dataset gives the same throws as the finished one, but in parts and in order of arrival."""
    finished = client.get(f"{URL}/a/throws").json()
    remember("growing", directory=str(directory))
    journal = directory / "logs" / "journal.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    commits = [number for number, line in enumerate(lines) if b'"commit"' in line]
    # The journal ends within the second commit, as if it was just being written.
    journal.write_bytes(b"".join(lines[: commits[1]]) + lines[commits[1]][:-20])
    first = client.get(f"{URL}/growing/throws").json()
    assert (len(first["trial"]), first["is_finished"], first["has_more"]) == (1, False, False)
    journal.write_bytes(b"".join(lines))
    then = client.get(f"{URL}/growing/throws", params={"first": first["following"]}).json()
    for name in ("outcome", "x_m", "y_m"):
        both = sorted(zip(first["trial"] + then["trial"], first[name] + then[name], strict=True))
        assert [value for _, value in both] == finished[name]
    last = client.get(f"{URL}/growing/throws", params={"first": then["following"]}).json()
    assert (last["trial"], last["following"]) == ([], then["following"])


def test_throws_that_ended_nowhere_are_listed_without_a_place(
    client: TestClient, directory: Path, remember: Remember
) -> None:
    remember("growing", directory=str(directory))
    commit = {"event": "commit", "time": 1.0, "trial": 1, "outcome": "dropped", "landing_x_m": None}
    (directory / "logs" / "journal.jsonl").write_text(f"{json.dumps(commit)}\n{json.dumps({**commit, 'trial': 99})}\n")
    found = client.get(f"{URL}/growing/throws").json()
    assert (found["trial"], found["outcome"], found["x_m"], found["y_m"]) == ([1], ["dropped"], [None], [None])


@pytest.mark.parametrize("grows", [False, True])
def test_a_stored_throw_is_given_as_it_was_recorded(
    client: TestClient, directory: Path, remember: Remember, grows: bool
) -> None:
    throw = (dataset := throwcollect.load(directory))[1]
    ball = throw.ball.position
    if grows:
        remember("growing", directory=str(directory))
        shard = directory / dataset.shards[0]
        shard.rename(path_of_part(shard))
    answer = client.get(f"{URL}/{'growing' if grows else 'a'}/throws/1")
    assert answer.headers["content-type"] == "application/octet-stream"
    header = read_header(answer.content)
    assert (header["trial"], header["outcome"], header["values"]) == (1, "landed", throw.parameters)
    assert header["landing"] == throw.events.landing.position.tolist()
    # Behind the angles of the joints come the path of the ball, and its poses.
    path = np.frombuffer(answer.content[-len(ball) * 10 * 4 :], "<f4")[: 3 * len(ball)]
    np.testing.assert_allclose(path.reshape(-1, 3), ball, rtol=1e-6)


def test_a_throw_that_is_not_stored_is_not_found(client: TestClient, directory: Path, remember: Remember) -> None:
    for trial in (99, -1):
        answer = client.get(f"{URL}/a/throws/{trial}")
        assert (answer.status_code, "no episode" in answer.json()["title"]) == (404, True)
    assert client.get(f"{URL}/a/throws/x").status_code == 422
    shutil.rmtree(directory)
    for path in ("throws", "throws/0"):
        answer = client.get(f"{URL}/a/{path}")
        assert answer.status_code == 404
        assert f"{directory} is not there" in answer.json()["title"]
