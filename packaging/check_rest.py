"""Tries the REST interface with requests that Schemathesis makes from its description.

    pip install schemathesis && python packaging/check_rest.py

It is no test, as Schemathesis brings fifty packages and is needed nowhere else. It asks for a run that has ended, its
dataset and a model of that, besides names that there are not; no other run is begun.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

import uvicorn

from throwcollect.collect.runs.records import Records
from throwcollect.errors import WorkerError
from throwcollect.serve import instances as instances_module
from throwcollect.serve.access import Access, Keys
from throwcollect.serve.app import make_app
from throwcollect.serve.catalogue import Catalogue
from throwcollect.state_directory import STATE_VARIABLE

_PORT = 8099
_EXAMPLES = 30
_LEFT_OUT = "unsupported_method"
"""Files of the page may lie at any path, so GET of a path that has other methods finds no file, and says so by 404."""


# How many numbers a target has depends on the model. Schemathesis 4.32 rewrites `prefixItems`, which OpenAPI 3.1 has,
# to a list in `items`, which it has not, and then takes its own schema for invalid.
_SETTINGS = """
[[operations]]
include-path = "/api/v1/models/{model}/aim"
checks.positive_data_acceptance.expected-statuses = ["2xx", "404", "422"]
[[operations]]
include-path = "/api/v1/collections/{instance}/landings"
checks.response_schema_conformance.enabled = false
"""
_CONFIG = """
name: small
trials: 60
sim: {engine: ballistic}
run: {replay: 0}
sweep:
  parameters:
    task.end.arm_right_4_joint: {min: -0.7, max: -0.4}
    task.duration_s: {min: 1.0, max: 1.2}
"""


def _collect(directory: Path) -> str:
    """Collect a dataset and learn a model from it; returns the id of the run."""
    data = directory / "data" / "small"
    models = directory / "models"
    command = [sys.executable, "-m", "throwcollect"]
    collect = ["up", "--runtime", "inprocess", "--output", str(data), str(directory / "small.yaml")]
    for words in (collect, ["fit", str(data), "--output", str(models / "small")]):
        subprocess.run([*command, *words], check=True, stdout=subprocess.DEVNULL)
    (run,) = Records().all()
    return run.id


def _begin(*_: Any, **__: Any) -> None:
    raise WorkerError("nothing is begun here")


def main() -> int:
    """Serve, and have it tried; the exit code is that of Schemathesis."""
    with tempfile.TemporaryDirectory() as scratch:
        directory = Path(scratch)
        os.environ[STATE_VARIABLE] = str(directory / "state")
        (directory / "small.yaml").write_text(_CONFIG)
        known = {"instance": _collect(directory), "node": "launcher", "path": "plan.parquet", "model": "small"}
        settings, names = directory / "settings.toml", directory / "names.toml"
        settings.write_text(_SETTINGS)
        lines = [f'"path.{name}" = "{value}"\n' for name, value in known.items()]
        names.write_text("".join(["[parameters]\n", *lines, _SETTINGS]))
        catalogue = directory / "catalogue.yaml"
        catalogue.write_text("components:\n  throws: {config: small.yaml}\n  talos: {session: small.yaml}\n")
        instances_module.begin_run = _begin  # type: ignore[assignment]
        keys, host = Keys(), f"127.0.0.1:{_PORT}"
        instances = instances_module.Instances(Catalogue.read(catalogue), directory / "data")
        app = Access(make_app(instances, directory / "models", keys), keys, frozenset({host}))
        server = uvicorn.Server(uvicorn.Config(app, port=_PORT, log_level="warning", ws="websockets-sansio"))
        threading.Thread(target=server.run, daemon=True).start()
        tried = [str(Path(sys.executable).parent / "schemathesis")]
        words = ["run", f"http://{host}/openapi.json", "--wait-for-schema", "20"]
        options = ["-H", f"Authorization: Bearer {keys.full}", "-n", str(_EXAMPLES), "--exclude-checks", _LEFT_OUT]
        codes = [
            subprocess.run([*tried, "--config-file", str(file), *words, *options], check=False).returncode
            for file in (names, settings)
        ]
        return max(codes)


if __name__ == "__main__":
    sys.exit(main())
