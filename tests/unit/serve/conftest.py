"""A server without a process: records in a directory of the test, and runs that nobody launches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient, WebSocketTestSession
from tests.e2e.collection import FAST, collect_here, write_config

from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.serve import instances as instances_module
from throwcollect.serve.access import Access, Keys
from throwcollect.serve.app import make_app
from throwcollect.serve.catalogue import Catalogue
from throwcollect.serve.instances import Instances
from throwcollect.state_directory import STATE_VARIABLE

HOST = "127.0.0.1:8080"
CONFIG = "name: small\ntrials: 3\ntask: {name: throw}\n"


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where runs are remembered."""
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    return tmp_path / "state"


@pytest.fixture(scope="session")
def collected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("collected")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE_VARIABLE, str(directory / "state"))
        collect_here(write_config(directory, trials=3, sim=FAST), directory / "data")
    return directory / "data"


@dataclass
class Served:
    """An application with its keys and its instances."""

    app: Access
    keys: Keys
    instances: Instances

    def client(self, token: str | None = None, *, fails: bool = True) -> TestClient:
        """A client with a token; by default, that which may do everything."""
        headers = {"Authorization": f"Bearer {self.keys.full if token is None else token}"} if token != "" else {}
        return TestClient(self.app, base_url=f"http://{HOST}", headers=headers, raise_server_exceptions=fails)

    def socket(self, path: str, token: str = "", **options: Any) -> WebSocketTestSession:
        """A socket, which a context opens; without a token by default."""
        return self.client(token).websocket_connect(f"ws://{HOST}{path}", **options)


@pytest.fixture
def catalogue(tmp_path: Path) -> Catalogue:
    (tmp_path / "small.yaml").write_text(CONFIG)
    path = tmp_path / "catalogue.yaml"
    path.write_text("components:\n  throws: {config: small.yaml, max_instances: 2}\n  talos: {session: small.yaml}\n")
    return Catalogue.read(path)


@pytest.fixture
def served(catalogue: Catalogue, tmp_path: Path) -> Served:
    keys = Keys()
    instances = Instances(catalogue, tmp_path / "datasets")
    return Served(Access(make_app(instances, tmp_path / "models", keys), keys, frozenset({HOST})), keys, instances)


@pytest.fixture
def client(served: Served) -> TestClient:
    # The client is not entered as a context, so background tasks of the application do not run.
    return served.client()


Remember = Callable[..., Run]


@pytest.fixture
def remember(tmp_path: Path) -> Iterator[Remember]:
    """Makes records; a run that `lives` is one whose lock this process holds."""
    opened: list[Run] = []

    def make(name: str = "small-0001", *, lives: bool = True, **fields: Any) -> Run:
        run = Records().new("small", run=name)
        values = {
            "logs": tmp_path / "datasets" / name / "logs",
            "launcher": 2**22,
            "simulations": 2,
        }
        record = run.begin("small", tmp_path / "datasets" / name, runtime="local")
        run.write(replace(record, **{**values, **fields}))
        if lives:
            opened.append(run)
        else:
            run.close()
        return run

    yield make
    for run in opened:
        run.close()


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch, remember: Remember) -> list[dict[str, Any]]:
    """A list of the orders of runs, filled by a stand-in that begins runs which live but do nothing."""
    asked: list[dict[str, Any]] = []

    def begin(config: Path, **options: Any) -> Run:
        asked.append({"config": config, **options})
        name = options.get("run") or f"resumed-{len(asked)}"
        remember(name, origin=options["origin"], kind=options.get("kind", "collection"))
        return Records().get(name)

    monkeypatch.setattr(instances_module, "begin_run", begin)
    return asked


def make_end_fields(**fields: Any) -> dict[str, Any]:
    """Fields of a run that has ended."""
    return {"lives": False, "ended": datetime.now(timezone.utc), "exit_code": 0, **fields}
