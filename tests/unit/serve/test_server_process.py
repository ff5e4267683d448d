"""The process of the server fails to start at an unusable address."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.unit.serve.conftest import Served

from throwcollect.errors import ConfigError
from throwcollect.serve.models import Models
from throwcollect.serve.server_process import serve


@pytest.mark.parametrize("host", ["é..b", "no host", "192.0.2.1"])
def test_serving_at_an_unusable_host_is_an_error(served: Served, host: str) -> None:
    with pytest.raises(ConfigError, match=f"--host {host} --port 0: cannot listen there: "):
        serve(served.instances, Models(Path()), host=host, port=0, tell=lambda *_: None)
