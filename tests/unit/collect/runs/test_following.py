from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

import pytest

from throwcollect.collect.runs.events import Event, append_events
from throwcollect.collect.runs.following import follow, read_logs
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.state_directory import STATE_VARIABLE


@pytest.fixture
def planned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Run, Callable[[], bool]]:
    """A run whose plan is being made, and a function whose second call launches the run and third call ends it."""
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    first, later = tmp_path / "first", tmp_path / "data" / "logs"
    run = Records().new("small")
    run.write(replace(run.begin("small", tmp_path / "data"), logs=first))
    first.mkdir()
    (first / "launcher.log").write_text("plan: 3 trials\n")
    append_events(later, [Event(run="of-an-earlier-run", event="started", simulations=1)])

    def launch() -> None:
        run.update(logs=later, runtime="local")
        (first / "launcher.log").rename(later / "launcher.log")
        (later / "sim_0.log").write_text("ready\n")
        append_events(later, [Event(run=run.id, event="started", simulations=1)])

    steps = iter([lambda: None, launch, lambda: run.update(ended=datetime.now(timezone.utc), exit_code=0)])

    def go_on() -> bool:
        next(steps, lambda: None)()
        return True

    return Records().get(run.id), go_on


def test_logs_are_followed_when_they_move_to_the_dataset(planned: tuple[Run, Callable[[], bool]]) -> None:
    run, go_on = planned
    lines = [(name, line) for name, line, _ in read_logs(run, (), until_end=True, keep_on=go_on)]
    assert lines == [("launcher", "plan: 3 trials"), ("sim_0", "ready")]


def test_follow_gives_only_events_of_this_run_even_if_its_logs_move(
    planned: tuple[Run, Callable[[], bool]],
) -> None:
    run, go_on = planned
    assert [event.run for look in follow(run, keep_on=go_on) for event in look.events] == [run.id]
