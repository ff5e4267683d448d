"""Requests about instances, without any process of a run."""

from __future__ import annotations

import shutil
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient
from tests.unit.serve.conftest import Remember, Served, make_end_fields

from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.run_record import NodeState, Origin, RunFailure
from throwcollect.config.run import ContainerSpec
from throwcollect.serve import instances as instances_module
from throwcollect.serve.catalogue import Catalogue

pytestmark = pytest.mark.usefixtures("begun")
URL = "/api/v1/instances"


def put(client: TestClient, name: str, **wish: Any) -> Any:
    return client.put(f"{URL}/{name}", json={"component": "throws", **wish})


def test_a_repeated_request_begins_no_second_instance(
    client: TestClient, begun: list[dict[str, Any]], tmp_path: Path
) -> None:
    wish = {"simulations": 3, "set": {"task.duration_s": 1.1, "sim.engine": "ballistic"}}
    first, again = put(client, "a", **wish), put(client, "a", **wish)
    assert (first.status_code, again.status_code) == (202, 200)
    assert first.json() == again.json()
    assert (first.json()["id"], first.json()["component"], first.json()["status"]) == ("a", "throws", "starting")
    (order,) = begun
    assert order["overrides"] == ["task.duration_s=1.1", 'sim.engine="ballistic"', "run.simulations=3"]
    assert (order["output"], order["kind"]) == (tmp_path / "datasets" / "a", "collection")
    put(client, "b", set={"name": "\U0001f600"})
    assert begun.pop()["overrides"] == ['name="\U0001f600"']
    other = put(client, "a", simulations=2)
    assert (other.status_code, other.json()["title"]) == (409, "there is an instance a already, of another request")
    assert len(begun) == 1


def test_an_id_with_an_existing_dataset_is_refused(
    client: TestClient, begun: list[dict[str, Any]], tmp_path: Path
) -> None:
    left = tmp_path / "datasets" / "a"
    left.mkdir(parents=True)
    (left / "throws.parquet").touch()
    said = put(client, "a")
    assert (said.status_code, said.json()["title"]) == (409, f"{left}: holds throws.parquet")
    assert said.json()["hint"] == "choose another id"
    assert not begun
    assert put(client, "b").status_code == 202


def test_a_component_never_has_more_than_max_instances(client: TestClient, remember: Remember) -> None:
    remember("old", **make_end_fields(origin=Origin("throws")))
    assert [put(client, name).status_code for name in ("a", "b", "c")] == [202, 202, 409]
    # Instances of another component and runs of commands do not count.
    remember("by-hand")
    assert client.put(f"{URL}/d", json={"component": "talos"}).status_code == 202
    assert client.put(f"{URL}/e", json={"component": "talos"}).json()["hint"] == "stop one of d"


def test_concurrent_clients_get_at_most_max_instances(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    begin = instances_module.begin_run

    def begin_slowly(*arguments: Any, **options: Any) -> Run:
        time.sleep(0.1)
        return begin(*arguments, **options)

    monkeypatch.setattr(instances_module, "begin_run", begin_slowly)
    with ThreadPoolExecutor(4) as pool:
        statuses = pool.map(lambda name: put(client, name).status_code, "abcd")
    assert sorted(statuses) == [202, 202, 409, 409]


def test_a_resumed_collection_counts_as_an_instance(client: TestClient, remember: Remember, tmp_path: Path) -> None:
    directory = tmp_path / "datasets" / "old"
    directory.mkdir(parents=True)
    (directory / "config.yaml").write_text("name: small\n")
    remember("old", **make_end_fields(origin=Origin("throws")))
    remember("none", **make_end_fields(origin=Origin("throws")))
    remember("session", **make_end_fields(kind="session"))
    resume = lambda name: client.post(f"/api/v1/collections/{name}/resume").status_code  # noqa: E731
    assert resume("old") == 202
    assert [resume(name) for name in ("nobody", "none", "session", "resumed-1")] == [404, 409, 409, 409]
    assert put(client, "a").status_code == 202
    assert resume("old") == 409


def test_a_dataset_that_another_run_goes_on_with_is_not_resumed(
    client: TestClient, remember: Remember, tmp_path: Path
) -> None:
    def list_resumable() -> bool:
        return {each["id"]: each for each in client.get("/api/v1/state").json()["instances"]}["old"]["can_be_resumed"]

    directory = tmp_path / "datasets" / "old"
    directory.mkdir(parents=True)
    (directory / "config.yaml").write_text("name: small\n")
    remember("old", **make_end_fields(origin=Origin("throws"), exit_code=130))
    assert list_resumable()
    remember("again", directory=str(directory))
    assert not list_resumable()
    said = client.post("/api/v1/collections/old/resume")
    assert (said.status_code, said.json()["title"]) == (409, f"{directory}: run again collects into it")


def test_the_state_says_which_collections_can_be_resumed(
    client: TestClient, begun: list[dict[str, Any]], collected: Path, remember: Remember, tmp_path: Path
) -> None:
    def list_resumable() -> dict[str, bool]:
        listed = {each["id"]: each["can_be_resumed"] for each in client.get("/api/v1/state").json()["instances"]}
        assert {name: client.get(f"{URL}/{name}").json()["can_be_resumed"] for name in listed} == listed
        return listed

    directory, left = tmp_path / "datasets" / "whole", tmp_path / "datasets" / "left"
    shutil.copytree(collected, directory)
    shutil.copytree(collected, left)
    (left / "metadata.yaml").unlink()
    remember("died", lives=False, directory=str(directory))
    remember("stopped", **make_end_fields(directory=str(directory), exit_code=130))
    remember("left", **make_end_fields(directory=str(left), exit_code=130))
    remember("finished", **make_end_fields(directory=str(directory)))
    remember("unplanned", **make_end_fields(exit_code=2))
    remember("session", **make_end_fields(kind="session", exit_code=130))
    remember("alive")
    resumable = list_resumable()
    assert {name for name, can in resumable.items() if can} == {"left"}
    # A later run finishes the one dataset; the other loses a file.
    shutil.copy(collected / "metadata.yaml", left)
    next(directory.glob("*.mcap")).unlink()
    resumable = list_resumable()
    assert {name for name, can in resumable.items() if can} == {"died", "stopped", "finished"}
    for name in sorted(resumable.keys() - {"alive"}):
        assert client.post(f"/api/v1/collections/{name}/resume").status_code == (202 if resumable[name] else 409), name


def test_a_container_can_join_a_run(
    served: Served, remember: Remember, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    joined: list[str | None] = []

    def begin(spec: ContainerSpec, *, run: str, origin: Origin, urdf: Path | None) -> Run:
        joined.append(origin.joins)
        directory = tmp_path / "datasets" / run
        directory.mkdir(parents=True)
        if urdf is not None:
            (directory / "robot.urdf").write_bytes(urdf.read_bytes())
        remember(run, origin=origin, kind="container", runtime="docker")
        return Records().get(run)

    monkeypatch.setattr(instances_module, "begin_container", begin)
    (tmp_path / "a.urdf").write_text("<robot/>")
    catalogue = tmp_path / "containers.yaml"
    catalogue.write_text(
        "components:\n  ear: {image: nodes, urdf: a.urdf}\n  deaf: {image: nodes}\n  talos: {session: small.yaml}\n"
    )
    object.__setattr__(served.instances, "catalogue", Catalogue.read(catalogue))
    client = served.client()
    ask = lambda name, **wish: client.put(f"{URL}/{name}", json=wish)  # noqa: E731
    first = ask("e", component="ear", joins="t")
    assert (first.status_code, first.json()["kind"], first.json()["joins"]) == (202, "container", "t")
    assert ask("e", component="ear", joins="t").status_code == 200
    assert ask("e", component="ear").status_code == 409
    assert (answer := ask("f", component="ear", joins="t")).status_code == 409
    assert answer.json()["title"] == "component ear: 1 instance lives, as many as max_instances allows"
    assert joined == ["t"]
    assert client.get(f"{URL}/e/urdf").text == "<robot/>"
    assert client.put(f"{URL}/e/urdf", content="<robot/>").status_code == 409
    patched = client.patch(f"{URL}/e", json={"simulations": 2})
    assert (patched.status_code, patched.json()["title"]) == (409, "run e: is a container, and has no simulations")
    assert ask("d", component="deaf").status_code == 202
    assert client.get(f"{URL}/d/urdf").status_code == 404
    for wish in ({"component": "deaf", "simulations": 1}, {"component": "deaf", "set": {"a": 1}}):
        assert ask("g", **wish).status_code == 422
    assert (
        ask("g", component="talos", joins="t").json()["title"]
        == "joins: talos is a session, for which this cannot be set"
    )


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("run.runtime", "inprocess"),
        ("run", {"runtime": "inprocess"}),
        ("run .runtime", "inprocess"),
        (" run.runtime", "inprocess"),
        ("run={runtime: inprocess} #", 1),
        ("trials=1\nrun.runtime", 1),
        ("containers.image", "ubuntu"),
        ("containers.mounts", ["/:/host"]),
        ("cluster", {}),
        ("sweep.file", "/etc/passwd"),
        ("sweep", {"sampler": "list", "file": "/etc/passwd"}),
        ("scene.bodies.crate.file", "/etc/passwd"),
        ("scene", {"bodies": {"crate": {"shape": "mesh", "file": "/etc/passwd"}}}),
        ("", 1),
    ],
)
def test_a_client_cannot_set_keys_of_the_operator(
    client: TestClient, begun: list[dict[str, Any]], key: str, value: Any
) -> None:
    answer = put(client, "a", set={"trials": 2, key: value})
    assert answer.status_code == 422, answer.text
    assert [problem["key"] for problem in answer.json()["problems"]]
    assert not begun


def test_an_instance_with_a_dead_launcher_can_be_cleared_but_not_scaled(client: TestClient, remember: Remember) -> None:
    remember("dead", lives=False)
    told = client.patch(f"{URL}/dead", json={"simulations": 1})
    assert (told.status_code, told.headers["content-type"]) == (409, "application/problem+json")
    assert told.json()["title"].startswith("run dead: its launcher died")
    assert client.delete(f"{URL}/dead").status_code == 202
    assert [client.get(f"{URL}/dead").status_code, client.delete(f"{URL}/dead").status_code] == [404, 404]


def test_the_state_lists_living_instances_and_the_latest_ended_ones(client: TestClient, remember: Remember) -> None:
    for number in range(103):
        remember(f"over-{number}", **make_end_fields())
    nodes = (NodeState("router", "running", 0, "1", ""), NodeState("sim_0", "running", 0, "2", ""))
    remember("living", origin=Origin("throws"), nodes=nodes)
    remember("lost", lives=False, nodes=(NodeState("sim_0", "running", 0, "2", ""),))
    remember("left", lives=False, runtime="docker", nodes=(NodeState("sim_0", "running", 0, "2", ""),))
    remember("failed", **make_end_fields(exit_code=2, failure=RunFailure("no plan", hint="mend it")))
    found = client.get("/api/v1/state").json()
    assert [each["status"] for each in found["instances"]][:3] == ["running", "ended", "died"]
    assert len(found["instances"]) == 101
    assert found["components"][0]["instances"] == ["living"]
    assert found["instances"][0]["robots"] == ["sim_0"]
    # Processes have ended with the launcher; containers outlive it.
    died = {each["id"]: each for each in found["instances"] if each["status"] == "died"}
    assert (died["lost"]["nodes"], died["lost"]["robots"]) == ([], [])
    assert died["left"]["robots"] == ["sim_0"]
    assert found["instances"][1]["message"] == "no plan\n  try: mend it"
    assert client.get(URL).json() == found["instances"]
    assert client.get("/api/v1/state").json() == found
