import pytest

from throwcollect.cli.printing import Display
from throwcollect.collect.coordinator.progress import Progress


def progress(ended: int, **outcomes: int) -> Progress:
    return Progress(total=10, ended=ended, outcomes=outcomes, simulations=2, throws_per_s=3.14, hung=[])


def test_the_progress_counts_failed_and_lost_trials() -> None:
    assert progress(3, landed=3).counts == "3 landed, 0 failed, 2 simulations, 3.1 throws/s"
    assert progress(6, landed=3, self_hit=1, timeout=1, lost=1).counts == (
        "3 landed, 2 failed, 1 lost, 2 simulations, 3.1 throws/s"
    )


def test_progress_lines_are_printed_at_intervals_and_once_at_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    with Display(quiet=False) as shown:
        for ended in (1, 2, 3, 10, 10, 10):
            shown.update(progress(ended, landed=ended))
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[0] for line in lines] == ["1/10", "10/10"]


def test_quiet_shows_only_warnings(capsys: pytest.CaptureFixture[str]) -> None:
    with Display(quiet=True) as shown:
        shown.say("plan: 10 trials")
        shown.update(progress(10, landed=10))
        shown.warn("sim_0 was lost")
    assert capsys.readouterr().err == "sim_0 was lost\n"
