"""A coordinator that nobody looks after, as on Compose."""

from __future__ import annotations

from pathlib import Path

from tests.commands import start_command
from tests.e2e.collection import write_config
from tests.integration.robot import environment
from throwcollect.ros.router import router


def test_a_coordinator_without_any_simulation_ends_with_an_error_that_says_so(tmp_path: Path) -> None:
    config = write_config(tmp_path, trials=2)
    config.write_text(config.read_text().replace("run: {", "run: {start_timeout_s: 0.5, "))
    with router("tcp/127.0.0.1:0") as endpoint:
        words = ("coordinator", tmp_path / "data", "--config", config)
        coordinator = start_command(*words, **environment(endpoint))
        try:
            _, said = coordinator.communicate(timeout=60)
        finally:
            coordinator.kill()
    assert coordinator.returncode == 3, said
    assert "no simulation was there for 0.5 s (run.start_timeout_s)" in said
    assert "Traceback" not in said
