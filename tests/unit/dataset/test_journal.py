from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path

import pytest

from throwcollect.dataset.journal import Journal, measure_collected_s, read_journal, was_open


def journal_of(directory: Path, *lines: str) -> None:
    (directory / "logs").mkdir(exist_ok=True)
    (directory / "logs" / "journal.jsonl").write_text("".join(lines))


def line(event: str, time: float) -> str:
    return json.dumps({"event": event, "time": time}) + "\n"


def events_of(directory: Path) -> list[str]:
    return [entry.event for entry in read_journal(directory / "logs" / "journal.jsonl")]


def test_journal_events_are_read_back_in_order_with_their_times(tmp_path: Path) -> None:
    with closing(Journal(tmp_path)) as journal:
        journal.note("lease", trial=3, simulation="sim_0")
        journal.note("commit", trial=3, outcome="landed", digest="00")
    events = list(read_journal(tmp_path / "logs" / "journal.jsonl"))
    assert [entry.event for entry in events] == ["opened", "lease", "commit"]
    assert events[0].time_s <= events[1].time_s <= events[2].time_s
    lease = json.loads((tmp_path / "logs" / "journal.jsonl").read_text().splitlines()[1])
    assert (lease["trial"], lease["simulation"]) == (3, "sim_0")


def test_an_incomplete_line_in_the_journal_does_not_spoil_the_next(tmp_path: Path) -> None:
    journal_of(tmp_path, line("opened", 1.0), '{"event": "comm')
    with closing(Journal(tmp_path)) as journal:
        journal.note("finished")
    assert events_of(tmp_path) == ["opened", "opened", "finished"]


DAMAGED = {
    "another event": '{"event": "nonsense", "time": 1}',
    "no time": '{"event": "commit"}',
    "a time beyond all numbers": f'{{"event": "commit", "time": {"9" * 400}}}',
    "a time that is NaN": '{"event": "commit", "time": NaN}',
    "a duration that is NaN": '{"event": "finished", "time": 2, "wall_s": NaN}',
    "an outcome that is a list": '{"event": "commit", "time": 2, "outcome": ["landed"]}',
    "a list without end": f'["lost", "exposed", {"[" * 100_000}',
}


@pytest.mark.parametrize("damaged", DAMAGED.values(), ids=DAMAGED)
def test_lines_of_the_journal_that_are_not_events_are_left_out(tmp_path: Path, damaged: str) -> None:
    journal_of(tmp_path, line("opened", 1.0), f"{damaged}\n", line("commit", 2.5))
    assert events_of(tmp_path) == ["opened", "commit"]
    assert (measure_collected_s(tmp_path), was_open(tmp_path)) == (1.5, False)


def test_the_journal_knows_whether_a_run_was_open_to_others(tmp_path: Path) -> None:
    assert not was_open(tmp_path)
    journal_of(tmp_path, line("opened", 1.0), line("exposed", 1.0), line("commit", 2.0))
    assert was_open(tmp_path)


def test_pauses_between_processes_do_not_count_as_collecting_time(tmp_path: Path) -> None:
    assert measure_collected_s(tmp_path) is None
    journal_of(tmp_path, line("opened", 10.0), line("commit", 12.5), line("opened", 1000.0), line("finished", 1004.0))
    assert measure_collected_s(tmp_path) == 6.5


def test_the_collecting_time_is_the_one_that_the_finished_event_states(tmp_path: Path) -> None:
    with closing(Journal(tmp_path)) as journal:
        journal.note("finished", wall_s=journal.measure_collected_s() + 20.0)
    assert measure_collected_s(tmp_path) == pytest.approx(20.0, abs=0.5)
    # The moment that finishing takes does not count; then another process goes on.
    journal_of(
        tmp_path,
        line("opened", 10.0),
        json.dumps({"event": "finished", "time": 15.0, "wall_s": 4.5}) + "\n",
        line("opened", 100.0),
        line("commit", 101.0),
    )
    assert measure_collected_s(tmp_path) == 5.5
