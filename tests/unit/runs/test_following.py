import os
import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path

import pytest

from throwcollect.runs.events import EventLog
from throwcollect.runs.record import Record
from throwcollect.runs.records import Records
from throwcollect.runs.state_directory import STATE_VARIABLE


@pytest.mark.parametrize("words", [("events",), ("logs", "-f")], ids=" ".join)
def test_what_follows_a_run_ends_with_its_reader_even_if_nothing_happens_any_more(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    logs = tmp_path / "logs"
    run = Records().new("small")
    started = datetime.now(timezone.utc)
    run.write(Record(run.run, "small", "local", str(tmp_path), None, str(logs), 0, started, os.getpid(), 1))
    EventLog(logs, run.run).run_event("started", simulations=1)
    (logs / "sim_0.log").write_text("ready\n")
    process = subprocess.Popen(
        [sys.executable, "-m", "throwcollect", *words, "--run", run.run],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    try:
        assert process.stdout.readline()
        process.stdout.close()
        assert process.wait(timeout=10) == 0
        assert process.stderr.read() == ""
    finally:
        process.kill()
        process.wait()
        process.stderr.close()
        run.close()
