"""Tries the REST interface with requests that Schemathesis makes from its description.

    pip install schemathesis && python packaging/check_rest.py

It is no test, as Schemathesis brings fifty packages and is needed nowhere else. No run is begun.
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

from throwcollect.errors import WorkerError
from throwcollect.runs.state_directory import STATE_VARIABLE
from throwcollect.serve import instances as instances_module
from throwcollect.serve.access import Access, Keys
from throwcollect.serve.app import make_app
from throwcollect.serve.catalogue import Catalogue
from throwcollect.serve.models import Models

_PORT = 8099
_EXAMPLES = 30
_LEFT_OUT = "unsupported_method"
"""Files of the page may lie at any path, so GET of a path that has other methods finds no file, and says so by 404."""


def _begin(*_: Any, **__: Any) -> None:
    raise WorkerError("nothing is begun here")


def main() -> int:
    """Serve, and have it tried; the exit code is that of Schemathesis."""
    with tempfile.TemporaryDirectory() as scratch:
        directory = Path(scratch)
        os.environ[STATE_VARIABLE] = str(directory / "state")
        (directory / "small.yaml").write_text("name: small\ntrials: 3\n")
        catalogue = directory / "catalogue.yaml"
        catalogue.write_text("components:\n  throws: {config: small.yaml}\n  talos: {session: small.yaml}\n")
        instances_module.begin_run = _begin  # type: ignore[assignment]
        keys, host = Keys(), f"127.0.0.1:{_PORT}"
        instances = instances_module.Instances(Catalogue.read(catalogue), directory / "data")
        app = Access(make_app(instances, Models(directory / "models"), keys), keys, frozenset({host}))
        server = uvicorn.Server(uvicorn.Config(app, port=_PORT, log_level="warning", ws="websockets-sansio"))
        threading.Thread(target=server.run, daemon=True).start()
        words = [str(Path(sys.executable).parent / "schemathesis"), "run", f"http://{host}/openapi.json"]
        options = ["-H", f"Authorization: Bearer {keys.full}", "-n", str(_EXAMPLES), "--exclude-checks", _LEFT_OUT]
        return subprocess.run([*words, *options, "--wait-for-schema", "20"], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
