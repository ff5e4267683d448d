"""Routes by which clients list models and aim with them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient
from tests.unit.serve.conftest import Served
from tests.unit.serve.made_model import KEYS, TARGETS, make_model

from throwcollect.learning.model import load_model
from throwcollect.learning.score import Errors, Score, ThrowAtTarget, Trained

URL = "/api/v1/models"


@pytest.fixture
def models(tmp_path: Path) -> Path:
    make_model(tmp_path / "models" / "quick")
    return tmp_path / "models"


def test_without_a_directory_no_models_are_listed(client: TestClient) -> None:
    assert client.get(URL).json() == []


def test_only_models_are_listed(client: TestClient, models: Path) -> None:
    (models / "notes").mkdir()
    make_model(models / ".hidden")
    (models / "a file").write_text("")
    assert client.get(URL).json() == ["quick"]


def test_a_model_is_described_with_parameters_targets_and_throws(client: TestClient, models: Path) -> None:
    found = client.get(f"{URL}/quick").json()
    assert (found["learned_from"], found["throws"], found["error"]) == ("quick", 400, 0.002)
    assert (found["parameters"], found["targets"], found["given"]) == (list(KEYS), list(TARGETS), [])
    assert len(found["reached"]) == 400
    assert found["score"] is found["adaptation"] is None


def test_a_model_shows_its_score_once_it_is_written(client: TestClient, models: Path) -> None:
    assert client.get(f"{URL}/quick").json()["score"] is None
    errors = Errors(throws=1, missed=0, median=0.01, share90=0.01, largest=0.01)
    throws = [ThrowAtTarget(target=[1.0, 0.0], place=[1.0, 0.01])]
    score = Score(
        targets=1,
        seed=0,
        trained=[Trained(trained_on=400, errors=errors)],
        throws=throws,
        scatter=0.0,
        adapted=[],
        adapted_throws=[],
    )
    load_model(models / "quick").write_score(models / "quick", score)
    assert client.get(f"{URL}/quick").json()["score"] == score.model_dump(mode="json")


def test_a_read_only_client_can_aim_at_a_target(served: Served, models: Path) -> None:
    # Aiming changes nothing, so a read-only client may do it.
    found = served.client(served.keys.read_only).get(f"{URL}/quick/aim", params={"at": [0.25, -0.5]}).json()
    assert found["reachable"]
    assert found["parameters"] == pytest.approx({"task.a": 0.25, "task.b": -0.5})
    assert found["predicted"] == pytest.approx([0.25, -0.5])


def test_a_target_out_of_reach_is_reported_with_the_nearest_point(client: TestClient, models: Path) -> None:
    found = client.get(f"{URL}/quick/aim", params={"at": [3, 3]}).json()
    assert not found["reachable"]
    assert found["nearest"] == pytest.approx([1, 1], abs=0.1)


@pytest.mark.parametrize("at", [[], [1], [1, 2, 3], ["nan", 0], ["inf", 0], ["x", 0], [0] * 17])
def test_a_malformed_target_is_refused(client: TestClient, models: Path, at: list[Any]) -> None:
    answer = client.get(f"{URL}/quick/aim", params={"at": at})
    assert answer.status_code == 422, answer.text


@pytest.mark.parametrize("name", ["none", "..", "..%2fquick", "%00", ".hidden", "quick%2f", 300 * "a"])
def test_names_that_are_no_models_are_not_found(client: TestClient, models: Path, name: str) -> None:
    make_model(models.parent / "models2")
    make_model(models / ".hidden")
    for path in (name, f"{name}/aim?at=0&at=0"):
        assert client.get(f"{URL}/{path}").status_code == 404, path


def test_a_symbolic_link_in_a_model_is_not_followed(client: TestClient, models: Path, tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("secret")
    (models / "quick" / "model.json").unlink()
    (models / "quick" / "model.json").symlink_to(tmp_path / "secret")
    assert client.get(f"{URL}/quick").status_code == 409
