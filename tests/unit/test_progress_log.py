"""Long work tells how far it has come, and short work nothing."""

import logging
from types import SimpleNamespace

import pytest

from throwcollect import progress_log
from throwcollect.progress_log import LOGGER, log_progress


@pytest.mark.parametrize(
    ("seconds_each", "said"),
    [
        (0.3, []),
        (0.7, ["3 of 5 trials written"]),
        (2.5, ["1 of 5 trials written", "2 of 5 trials written", "3 of 5 trials written", "4 of 5 trials written"]),
    ],
)
def test_work_is_logged_every_two_seconds_until_its_end(
    seconds_each: float, said: list[str], caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 100.0
    monkeypatch.setattr(progress_log, "time", SimpleNamespace(monotonic=lambda: now_s))
    done = []
    with caplog.at_level(logging.INFO, logger=LOGGER):
        for item in log_progress(range(5), 5, "trial", "written"):
            done.append(item)
            now_s += seconds_each
    assert done == [0, 1, 2, 3, 4]
    assert caplog.messages == said


def test_programs_that_do_not_ask_for_progress_see_none(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress_log, "_EVERY_S", 0.0)
    monkeypatch.setattr(logging.getLogger(LOGGER), "handlers", [])
    assert list(log_progress("ab", 2, "trial", "written")) == ["a", "b"]
    assert capsys.readouterr().err == ""
